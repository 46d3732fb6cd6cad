#pragma once
// The inner loop of the `cpu` renderer. Sixteen rays advance together from voxel plane to voxel plane across their main
// axis, and in every plane are interpolated bilinearly (Joseph, IEEE TMI 1, 1982): the trapezoid rule on the trilinear
// interpolation. Blocks of voxels that are empty are skipped.

#include <array>
#include <cstddef>
#include <cstdint>

namespace isoshift {

inline constexpr int kPacketRays = 16;
inline constexpr int kSkipEdge = 8;  // voxels along each edge of a block that can be skipped

// Planes lie across the main axis, rows in a plane, columns in a row; columns are neighbors in memory. Rays stay at
// least one voxel below the last column, row and plane.
template <class T>
struct PlaneLattice {
  const T* voxels = nullptr;
  std::ptrdiff_t plane_stride = 0, row_stride = 0;
  int columns = 0, rows = 0;

  const std::uint8_t* occupied = nullptr;  // 0: all voxels of the block are 0
  std::ptrdiff_t plane_block_stride = 0, column_block_stride = 0, row_block_stride = 0;
};

// Rays from one source, all with or all against their main axis. In plane p, ray n meets column[n] + (p - plane) *
// column_slope[n], and likewise its row. A ray counts from first_plane to last_plane. If a packet has fewer than
// sixteen rays, its other places repeat the first ray.
struct RayPacket {
  int plane = 0;
  bool forward = true;  // with the main axis
  double source_plane = 0.0, source_column = 0.0, source_row = 0.0;
  alignas(64) std::array<float, kPacketRays> column, row, column_slope, row_slope;
  alignas(64) std::array<std::int32_t, kPacketRays> first_plane, last_plane;
};

// Sum of the interpolated values over the planes of each ray, in units of stored voxels.
using PacketSums = std::array<float, kPacketRays>;
PacketSums march(const RayPacket& packet, const PlaneLattice<std::uint8_t>& lattice);
PacketSums march(const RayPacket& packet, const PlaneLattice<std::uint16_t>& lattice);
PacketSums march(const RayPacket& packet, const PlaneLattice<float>& lattice);

// The same sums, and those of the interpolation's derivatives by column and by row: plain, and times the number of
// planes from RayPacket::plane.
struct PacketGradients {
  alignas(64) PacketSums value, by_column, by_row, by_column_slope, by_row_slope;
};
PacketGradients march_with_gradients(const RayPacket& packet, const PlaneLattice<std::uint8_t>& lattice);
PacketGradients march_with_gradients(const RayPacket& packet, const PlaneLattice<std::uint16_t>& lattice);
PacketGradients march_with_gradients(const RayPacket& packet, const PlaneLattice<float>& lattice);

// The instruction set chosen at run time, for the log.
const char* march_instruction_set();

}  // namespace isoshift
