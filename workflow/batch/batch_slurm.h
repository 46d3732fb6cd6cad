#pragma once
// A batch as a job array of Slurm, the scheduler that clusters have.

#include <filesystem>
#include <string>
#include <vector>

namespace isoshift {

// Writes slurm.sh (a shard per task) and slurm-merge.sh into the folder of the batch, and submits both. slurm-merge.sh
// runs when all tasks have ended. `arguments`: the arguments of isoshift, without those that choose a shard. Returns
// the answer of sbatch. Throws Error if sbatch refuses or is not installed. Partition, time and similar settings come
// from sbatch's environment (SBATCH_...).
std::string submit_to_slurm(const std::filesystem::path& folder, const std::vector<std::string>& arguments, int tasks);

}  // namespace isoshift
