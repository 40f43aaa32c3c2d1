// From where a view looks, and so far away that all that is ever drawn is in it.

const EYE = [0.74, 0.55, 0.39]; // direction of the first look, of length 1
// From where the other looks come, in the drawing's axes: glTF faces z (drawn x), CAD faces -y.
const LOOKS = {
  y: { Front: [1, 0, 0.02], Side: [0, 1, 0.02], Top: [0.02, 0, 1] },
  z: { Front: [0, -1, 0.02], Side: [1, 0, 0.02], Top: [0, -0.02, 1] },
};
const HALF_VIEW = Math.tan(Math.PI / 8); // plotly's field of view is 45 degrees, top to bottom
const MARGIN = 1.02;

// Distance from the middle of a box of half extents `half` at which all its corners are in view.
function fittingDistance(half, aspect, from) {
  const level = Math.hypot(from[0], from[1]);
  const right = [-from[1] / level, from[0] / level, 0];
  const up = [-from[2] * from[0] / level, -from[2] * from[1] / level, level];
  const signs = [-1, 1];
  const corners = signs.flatMap((i) => signs.flatMap((j) => signs.map((k) => [i * half[0], j * half[1], k * half[2]])));
  const reach = (c) => Math.max(Math.abs(dot(c, up)), Math.abs(dot(c, right)) / aspect);
  return MARGIN * Math.max(...corners.map((c) => dot(c, from) + reach(c) / HALF_VIEW));
}

// Plotly's camera that looks from a direction at the middle of a drawing of that range.
function lookAt(from, range, aspect) {
  const size = range.map(([lo, hi]) => hi - lo || 1e-9), most = Math.max(...size);
  const way = from.map((x) => x / Math.hypot(...from));
  const away = fittingDistance(size.map((x) => x / 2 / most), aspect, way);
  const named = ([x, y, z]) => ({ x, y, z });
  return { center: named([0, 0, 0]), eye: named(way.map((part) => away * part)), up: { x: 0, y: 0, z: 1 } };
}
