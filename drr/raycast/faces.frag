// faces.frag: the position on the bounding structure as a color (Spoerk et al. 2012, 2.2); alpha says that there is one.

layout(location = 0) in vec3 position_voxel;
layout(location = 0) out vec4 color;

void main() { color = vec4(position_voxel, 1.0); }
