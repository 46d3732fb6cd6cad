// faces.vert: the faces of the bounding structure, one instance per square; its position in continuous voxel indices goes
// to the fragments. Faces that do not look toward the wanted side are moved out of sight (docs/renderers.md, "Ray casting").

layout(location = 0) in uvec4 face;  // block x, y, z and where the face looks: 0 -x, 1 +x, 2 -y, 3 +y, 4 -z, 5 +z

layout(location = 0) uniform mat4 clip_from_voxel;
layout(location = 4) uniform vec3 source_voxel;
layout(location = 5) uniform vec3 block_edge;    // voxels; block b covers the positions from b * edge - 1, as many again
layout(location = 6) uniform vec3 highest;       // position beyond which there is nothing
layout(location = 7) uniform uint toward_source;

layout(location = 0) out vec3 position_voxel;

void main() {
  int axis = int(face.w) / 2;
  bool high = face.w % 2u == 1u;
  vec3 corner = vec3(0.0);
  corner[axis] = high ? 1.0 : 0.0;
  corner[(axis + 1) % 3] = float(gl_VertexID & 1);
  corner[(axis + 2) % 3] = float(gl_VertexID >> 1);
  position_voxel = min((vec3(face.xyz) + corner) * block_edge - 1.0, highest);
  float way_to_source = source_voxel[axis] - position_voxel[axis];
  bool looks_at_source = high ? way_to_source > 0.0 : way_to_source < 0.0;
  gl_Position = looks_at_source == (toward_source != 0u) ? clip_from_voxel * vec4(position_voxel, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
