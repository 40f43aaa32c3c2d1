// What holds and loads a body, at rest: squares where it is held, arrows where it is pushed.

const HELD_COLOR = "#2f7fd1", LOAD_COLOR = "#d33a2c", MOVE_COLOR = "#8a4fc0", OBSTACLE_COLOR = "#6b7178";
const ARROW_SHARE = 0.12; // of the longest side: the arrow of the largest load
const HEAD_SHARE = 0.35, HEAD_WIDTH = 0.25; // of the arrow, and of its head
const FAINTEST = 0.02; // of the largest load: arrows below it would be dots
const HEAD_SIDES = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 3, 2], [1, 4, 3]];

function arrowTail(row, length) {
  return [0, 1, 2].map((i) => row[i] - length * row[3 + i]);
}

// Tip and four corners of the base of an arrow's head.
function arrowHead(row, length) {
  const way = row.slice(3), size = Math.hypot(...way), unit = way.map((x) => x / size);
  const across = Math.abs(unit[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const side = cross(unit, across), wide = Math.hypot(...side), p = side.map((x) => x / wide), q = cross(unit, p);
  const long = HEAD_SHARE * length * size;
  const base = (a, b) => [0, 1, 2].map((i) => row[i] + long * (-unit[i] + HEAD_WIDTH * (a * p[i] + b * q[i])));
  return [row.slice(0, 3), base(1, 1), base(-1, 1), base(-1, -1), base(1, -1)];
}

class Marks {
  // `placed` turns places [m] into drawn coordinates; `length` [m] is the largest arrow's.
  constructor(packed, length, placed) {
    [this.packed, this.length, this.placed] = [packed, length, placed];
  }
  // Where arrows start and obstacles stand [m].
  places() {
    if (!this.packed) return [];
    const { arrows, moved, outlines } = this.packed;
    return [...arrows, ...moved].map((row) => arrowTail(row, this.length)).concat(outlines.map((row) => row.slice(0, 3)));
  }
  traces() {
    if (!this.packed) return [];
    const { held, moved, arrows, outlines, floors } = this.packed;
    return [this.squares(held), this.lines(outlines), this.planes(floors), this.arrows(arrows, LOAD_COLOR), this.arrows(moved, MOVE_COLOR)].flat();
  }
  squares(held) {
    if (!held.length) return [];
    return [{ type: "scatter3d", mode: "markers", marker: { size: 3, symbol: "square", color: HELD_COLOR }, ...this.placed(held) }];
  }
  // Around obstacles, where they start.
  lines(outlines) {
    if (!outlines.length) return [];
    const ends = outlines.flatMap((row) => [row.slice(0, 3), row.slice(3), null]);
    return [{ type: "scatter3d", mode: "lines", line: { width: 3, color: OBSTACLE_COLOR }, ...this.placed(ends) }];
  }
  planes(floors) {
    const fill = { type: "mesh3d", i: [0, 0], j: [1, 2], k: [2, 3], color: OBSTACLE_COLOR, opacity: 0.25 };
    return floors.map((corners) => ({ ...fill, ...this.placed(corners) }));
  }
  // Shafts, and pyramids whose tips are where the load meets the surface.
  arrows(rows, color) {
    const shown = rows.filter((row) => Math.hypot(...row.slice(3)) > FAINTEST);
    if (!shown.length) return [];
    const shafts = shown.flatMap((row) => [arrowTail(row, this.length), row.slice(0, 3), null]);
    const heads = shown.map((row) => arrowHead(row, this.length));
    const corners = heads.flat();
    const sides = heads.flatMap((_, n) => HEAD_SIDES.map((side) => side.map((k) => 5 * n + k)));
    const [i, j, k] = [0, 1, 2].map((at) => sides.map((side) => side[at]));
    return [
      { type: "scatter3d", mode: "lines", line: { width: 4, color }, ...this.placed(shafts) },
      { type: "mesh3d", i, j, k, color, flatshading: true, lighting: LIGHT, ...this.placed(corners) },
    ];
  }
}
