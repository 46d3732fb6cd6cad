// splat.frag: what a voxel adds to its pixel; the blending adds up.

layout(location = 0) flat in float deposit;
layout(location = 0) out float line_integral;

void main() { line_integral = deposit; }
