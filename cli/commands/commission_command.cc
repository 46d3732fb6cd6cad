// isoshift qa commission: what a site's sessions with known moves prove about its localization.

#include <memory>

#include "base/error.h"
#include "cli/commands/commands.h"
#include "workflow/commission/commission_files.h"

namespace isoshift {
namespace {

struct CommissionFlags {
  CommissionRequest request;
  std::filesystem::path moves, positions;
  bool as_json = false;
};

int exit_status_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::kPassed: return kExitAccepted;
    case Outcome::kUntested: return kExitReview;
    case Outcome::kFailed: return kExitRejected;
  }
  return kExitFailed;
}

int run_commission(CommissionFlags& flags, Console& console) {
  CommissionRequest& request = flags.request;
  if (!flags.moves.empty() && !flags.positions.empty())
    throw UsageError("--moves and --positions: give one of them; positions hold the moves between them");
  if (!request.key.empty() && request.by.empty()) throw UsageError("--key needs --by: whose key it is");
  if (!request.key.empty() && request.output.empty()) throw UsageError("--key needs -o: what it signs");
  request.known = !flags.moves.empty()       ? Known::kMoves
                  : !flags.positions.empty() ? Known::kPositions
                                             : Known::kReadOuts;
  request.known_poses = !flags.moves.empty() ? flags.moves : flags.positions;
  const Commission commission = commission_of(request);
  if (!request.output.empty()) write_commission(commission, request);
  console.out << (flags.as_json ? commission_json(commission, "", "") : commission_text(commission));
  return exit_status_of(commission.outcome());
}

}  // namespace

void add_commission_command(CLI::App& app, Console& console, int& exit_status) {
  auto flags = std::make_shared<CommissionFlags>();
  CommissionRequest& request = flags->request;
  CLI::App* command = app.add_subcommand(
      "commission", "Test a site's localization by registered sessions of a phantom whose moves are known");
  command->footer(
      "\nExample:\n  isoshift batch sessions/ -o results\n"
      "  isoshift qa commission results --site site.json -o commissioning --by \"J. Doe\" --key site-key.pem\n\n"
      "Without --moves or --positions the moves are those of the table's read-outs, from the first session.\n"
      "Exit status: 0 all passed, 1 failed, 2 usage, 3 something was not tested, 4 a test failed.");
  command->add_option("results", request.results, "Folder of registered sessions, as batch writes it")
      ->required()
      ->type_name("FOLDER");
  command
      ->add_option("--moves", flags->moves,
                   "CSV of how the phantom lay in every session, up to one motion that all share: session, x_mm, y_mm, "
                   "z_mm, rx_deg, ry_deg, rz_deg")
      ->type_name("FILE");
  command
      ->add_option("--positions", flags->positions,
                   "The same of where the phantom lay against its plan: tests positions, not only moves")
      ->type_name("FILE");
  command->add_option("--site", request.site, "Site file with localization_limits")->type_name("FILE");
  CLI::Option* output =
      command
          ->add_option("-o,--output", request.output, "Folder for commission.pdf, commission.csv and commission.json")
          ->type_name("FOLDER");
  command->add_option("--by", request.by, "Who answers for it")->type_name("NAME");
  command->add_option("--key", request.key, "Private Ed25519 key (PEM) that signs commission.json")->type_name("FILE");
  command->add_flag("--overwrite", request.overwrite, "Replace an earlier output in that folder")->needs(output);
  command->add_flag("--json", flags->as_json, "Print JSON instead of text");
  command->callback([flags, &console, &exit_status] { exit_status = run_commission(*flags, console); });
}

}  // namespace isoshift
