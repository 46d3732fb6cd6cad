#pragma once
// One function per command: it adds flags to the command line and, when the command is chosen, runs it.

#include <CLI/CLI.hpp>

#include "cli/console.h"

namespace isoshift {

void add_inspect_command(CLI::App& app, Console& console, int& exit_status);
void add_check_command(CLI::App& app, Console& console, int& exit_status);
void add_register_command(CLI::App& app, Console& console, int& exit_status);
void add_batch_command(CLI::App& app, Console& console, int& exit_status);
void add_report_command(CLI::App& app, Console& console, int& exit_status);
void add_drr_command(CLI::App& app, Console& console, int& exit_status);
void add_phantom_command(CLI::App& app, Console& console, int& exit_status);
void add_track_command(CLI::App& app, Console& console, int& exit_status);
void add_commission_command(CLI::App& app, Console& console, int& exit_status);
void add_geometry_command(CLI::App& app, Console& console, int& exit_status);
void add_scout_command(CLI::App& app, Console& console, int& exit_status);
void add_predict_command(CLI::App& app, Console& console, int& exit_status);
void add_watch_command(CLI::App& app, Console& console, int& exit_status);
void add_serve_command(CLI::App& app, Console& console, int& exit_status);
void add_view_command(CLI::App& app, Console& console, int& exit_status);
void add_delete_command(CLI::App& app, Console& console, int& exit_status);
void add_release_command(CLI::App& app, Console& console, int& exit_status);
void add_audit_command(CLI::App& app, Console& console, int& exit_status);
void add_audit_setup_command(CLI::App& app, Console& console, int& exit_status);
void add_deidentify_command(CLI::App& app, Console& console, int& exit_status);
void add_bundle_command(CLI::App& app, Console& console, int& exit_status);
void add_evaluate_command(CLI::App& app, Console& console, int& exit_status);
void add_bench_command(CLI::App& app, Console& console, int& exit_status);

}  // namespace isoshift
