// Setup errors, as result.json has them: {translation_mm: [x, y, z], rotation_matrix: [row, row, row]}, along the room's
// axes (IEC 61217 fixed): anatomy planned at p, mm from the isocenter, lies at R p + t.

export const planned = {translation_mm: [0, 0, 0], rotation_matrix: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]};

const rad = Math.PI / 180;
const dot = (a, b) => a.reduce((sum, value, n) => sum + value * b[n], 0);
const column = (rows, n) => rows.map(row => row[n]);
const times = (a, b) => a.map(row => [0, 1, 2].map(n => dot(row, column(b, n))));

// A rotation by an angle about an axis of length 1.
function rotation(axis, deg) {
  const [x, y, z] = axis, c = Math.cos(deg * rad), s = Math.sin(deg * rad), k = 1 - c;
  return [[c + k * x * x, k * x * y - s * z, k * x * z + s * y],
          [k * y * x + s * z, c + k * y * y, k * y * z - s * x],
          [k * z * x - s * y, k * z * y + s * x, c + k * z * z]];
}

export const moved = (pose, mm) => ({...pose, translation_mm: pose.translation_mm.map((value, n) => value + mm[n])});

// Turned in the room about the anatomy that was planned at the isocenter, which stays where it lies.
export const turned = (pose, axis, deg) =>
  ({...pose, rotation_matrix: times(rotation(axis, deg), pose.rotation_matrix)});

// The angles about x, y and z of R = Rz Rx Ry, in degrees, as the report prints them.
export function anglesDeg(pose) {
  const r = pose.rotation_matrix;
  return [Math.asin(Math.max(-1, Math.min(1, r[2][1]))), Math.atan2(-r[2][0], r[2][2]), Math.atan2(-r[0][1], r[1][1])]
    .map(angle => angle / rad);
}

export const fromNumbers = (mm, deg) => ({
  translation_mm: mm,
  rotation_matrix: times(times(rotation([0, 0, 1], deg[2]), rotation([1, 0, 0], deg[0])), rotation([0, 1, 0], deg[1]))
});

// The shortest motion in the room (mm) that moves what lies at the isocenter by so many pixels of a view.
export function motionOf(pixelsPerMm, [right, down]) {
  const [a, b] = pixelsPerMm;  // the rows: columns and rows of pixels per mm along x, y and z
  const aa = dot(a, a), ab = dot(a, b), bb = dot(b, b), size = aa * bb - ab * ab;
  const u = (bb * right - ab * down) / size, v = (aa * down - ab * right) / size;
  return a.map((value, n) => u * value + v * b[n]);
}
