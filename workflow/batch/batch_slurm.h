#pragma once
// A batch as a job array of Slurm, the scheduler that clusters have.

#include <filesystem>
#include <string>
#include <vector>

namespace isoshift {

// Writes slurm.sh (a shard per task) and slurm-merge.sh into the folder of the batch and submits both, the second for
// when all tasks have ended. `arguments`: of isoshift, without those of the part. Returns what sbatch answered. Throws
// Error where it refuses or is not there. Partition, time and the like are taken from sbatch's environment
// (SBATCH_...).
std::string submit_to_slurm(const std::filesystem::path& folder, const std::vector<std::string>& arguments, int tasks);

}  // namespace isoshift
