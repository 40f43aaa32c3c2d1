// One 3D view: a case drawn in the common state {map, shape, cut, factor, frame}.

// Axis order that puts the asset's up axis last, a rotation (no mirror): plotly turns about z.
const ORDER = { x: [1, 2, 0], y: [2, 0, 1], z: [0, 1, 2] };
// Plotly takes faces below an absolute size as flat: everything is drawn this many units long.
const DRAWN_SIZE = 100;
const LIGHT = { ambient: 0.5, diffuse: 0.55, specular: 0.05, roughness: 0.8, fresnel: 0.02 };
const EYE = [0.74, 0.55, 0.39]; // direction of the first look, of length 1
const HALF_VIEW = Math.tan(Math.PI / 8); // plotly's field of view is 45 degrees, top to bottom
const MARGIN = 1.02;
const HELD_COLOR = "#2f7fd1", LOAD_COLOR = "#d33a2c", MOVE_COLOR = "#8a4fc0", OBSTACLE_COLOR = "#6b7178";
const ARROW_SHARE = 0.12; // of the longest side: the arrow of the largest load
const HEAD_SHARE = 0.35, HEAD_WIDTH = 0.25; // of the arrow, and of its head
const FAINTEST = 0.02; // of the largest load: arrows below it would be dots

// Distance from the middle of a box of half extents `half` at which all its corners are in view.
function fittingDistance(half, aspect) {
  const level = Math.hypot(EYE[0], EYE[1]);
  const right = [-EYE[1] / level, EYE[0] / level, 0];
  const up = [-EYE[2] * EYE[0] / level, -EYE[2] * EYE[1] / level, level];
  const signs = [-1, 1];
  const corners = signs.flatMap((i) => signs.flatMap((j) => signs.map((k) => [i * half[0], j * half[1], k * half[2]])));
  const reach = (c) => Math.max(Math.abs(dot(c, up)), Math.abs(dot(c, right)) / aspect);
  return MARGIN * Math.max(...corners.map((c) => dot(c, EYE) + reach(c) / HALF_VIEW));
}

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

class View {
  constructor(index, packed, tets, up) {
    this.node = document.getElementById(`plot${index}`);
    this.readout = document.getElementById(`readout${index}`);
    this.tets = tets;
    this.order = ORDER[up];
    this.values = {};
    for (const name of ["E", "nu", "rho", "von_mises"]) {
      if (packed[name]) this.values[name] = unpack(packed[name], Float32Array);
    }
    this.frames = {};
    for (const shape of ["displacement", "motion"]) {
      if (packed[shape]) this.frames[shape] = new Frames(packed[shape], tets.pointCount);
    }
    this.times = packed.times || [];
    this.marks = packed.marks || null;
    this.arrowLength = ARROW_SHARE * Math.max(...tets.hi.map((h, i) => h - tets.lo[i]));
    this.zoom = DRAWN_SIZE / Math.max(...tets.hi.map((h, i) => h - tets.lo[i]));
  }
  // Displacement [m] of all points in this state, or null at rest.
  displacement(state) {
    const frames = this.frames[state.shape];
    if (!frames) return null;
    return frames.at(state.shape === "motion" ? Math.min(state.frame, frames.count - 1) : 0);
  }
  // [smallest, largest] of what the map shows, over all frames for displacements.
  extent(name) {
    if (name === "moved") {
      return [0, Math.max(0, ...Object.values(this.frames).map((f) => f.largest()))];
    }
    const values = this.values[name];
    if (!values) return [Infinity, -Infinity];
    return [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
  }
  // Room [m] that the shape takes at rest and at the largest exaggeration.
  room(factor) {
    const lo = [...this.tets.lo], hi = [...this.tets.hi];
    for (const frames of Object.values(this.frames)) {
      const [down, up] = frames.bounds();
      for (let axis = 0; axis < 3; axis += 1) {
        lo[axis] = Math.min(lo[axis], this.tets.lo[axis] + factor * down[axis]);
        hi[axis] = Math.max(hi[axis], this.tets.hi[axis] + factor * up[axis]);
      }
    }
    const { arrows, moved, outlines } = this.marks || { arrows: [], moved: [], outlines: [] };
    const tails = [...arrows, ...moved].map((row) => arrowTail(row, this.arrowLength));
    for (const tail of [...tails, ...outlines.map((row) => row.slice(0, 3))]) {
      for (let axis = 0; axis < 3; axis += 1) {
        lo[axis] = Math.min(lo[axis], tail[axis]);
        hi[axis] = Math.max(hi[axis], tail[axis]);
      }
    }
    return [lo, hi];
  }
  trace(state, scale) {
    if (this.cut !== state.cut || !this.faces) {
      this.faces = this.tets.surface(this.tets.kept(state.cut));
      this.cut = state.cut;
    }
    this.moved = this.displacement(state);
    const { a, b, c } = this.faces;
    const [x, y, z] = this.order.map((axis) => this.coordinates(axis, state.factor));
    const paint = scale ? this.paint(state.map, scale) : this.paintParts();
    return { type: "mesh3d", x, y, z, i: a, j: b, k: c, hoverinfo: "none", flatshading: false,
      lighting: LIGHT, lightposition: { x: 1400, y: 400, z: 1500 }, showscale: false, ...paint };
  }
  // What holds and loads the body, at rest: squares where it is held, arrows where it is pushed.
  marked() {
    if (!this.marks) return [];
    const { held, moved, arrows, outlines } = this.marks, length = this.arrowLength;
    return [this.squares(held), this.lines(outlines), ...this.arrows(arrows, LOAD_COLOR, length), ...this.arrows(moved, MOVE_COLOR, length)].flat();
  }
  placed(rows) {
    const [x, y, z] = this.order.map((axis) => rows.map((row) => (row === null ? null : this.zoom * row[axis])));
    return { x, y, z, hoverinfo: "none", showlegend: false };
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
  // Shafts, and pyramids whose tips are where the load meets the surface.
  arrows(rows, color, length) {
    const shown = rows.filter((row) => Math.hypot(...row.slice(3)) > FAINTEST);
    if (!shown.length) return [];
    const shafts = shown.flatMap((row) => [arrowTail(row, length), row.slice(0, 3), null]);
    const heads = shown.map((row) => arrowHead(row, length));
    const corners = heads.flat();
    const sides = heads.flatMap((_, n) => HEAD_SIDES.map((side) => side.map((k) => 5 * n + k)));
    const [i, j, k] = [0, 1, 2].map((at) => sides.map((side) => side[at]));
    return [
      { type: "scatter3d", mode: "lines", line: { width: 4, color }, ...this.placed(shafts) },
      { type: "mesh3d", i, j, k, color, flatshading: true, lighting: LIGHT, ...this.placed(corners) },
    ];
  }
  coordinates(axis, factor) {
    return Float32Array.from(this.faces.origin, (point) => {
      const moved = this.moved ? factor * this.moved[3 * point + axis] : 0;
      return this.zoom * (this.tets.points[3 * point + axis] + moved);
    });
  }
  length(point) {
    return this.moved ? Math.hypot(...this.moved.subarray(3 * point, 3 * point + 3)) : 0;
  }
  paint(name, scale) {
    const shade = { colorscale: scale.colorscale, cmin: 0, cmax: 1 };
    if (name === "moved") {
      const intensity = Float32Array.from(this.faces.origin, (point) => scale.share(this.length(point)));
      return { ...shade, intensity, intensitymode: "vertex" };
    }
    const intensity = this.faces.owner.map((tet) => scale.share(this.values[name][tet]));
    return { ...shade, intensity, intensitymode: "cell" };
  }
  // Bands of one colour each, not `facecolor`: plotly would tint that with the map shown before.
  paintParts() {
    const count = Math.min(this.tets.names.length, MOST_PART_COLORS);
    const colorscale = Array.from({ length: count }, (_, i) => [0, 1].map((end) => [(i + end) / count, partColor(i)])).flat();
    const intensity = this.faces.owner.map((tet) => ((this.tets.region[tet] % count) + 0.5) / count);
    return { colorscale, cmin: 0, cmax: 1, intensity, intensitymode: "cell" };
  }
  layout(room) {
    const range = this.order.map((i) => [this.zoom * room[0][i], this.zoom * room[1][i]]);
    const axis = (i) => ({ visible: false, range: range[i] });
    const size = range.map(([lo, hi]) => hi - lo || 1e-9);
    const most = Math.max(...size);
    return {
      margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", hovermode: "closest",
      scene: {
        xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), dragmode: "turntable",
        aspectmode: "manual", aspectratio: { x: size[0] / most, y: size[1] / most, z: size[2] / most },
        camera: this.camera || this.firstCamera(range, most),
      },
    };
  }
  // Looks at the middle of the shape at rest; `unit` is how much of the drawing is one camera unit.
  firstCamera(range, unit) {
    const rest = this.order.map((axis) => [this.tets.lo[axis], this.tets.hi[axis]].map((x) => (this.zoom * x) / unit));
    const middle = rest.map(([lo, hi], i) => (lo + hi) / 2 - (range[i][0] + range[i][1]) / 2 / unit);
    const aspect = this.node.clientWidth / this.node.clientHeight || 1;
    const away = fittingDistance(rest.map(([lo, hi]) => (hi - lo) / 2), aspect);
    const named = ([x, y, z]) => ({ x, y, z });
    return { center: named(middle), eye: named(EYE.map((part, i) => middle[i] + away * part)), up: { x: 0, y: 0, z: 1 } };
  }
  async draw(state, scale, room) {
    const config = { displayModeBar: false, responsive: true, scrollZoom: true };
    const marks = state.marks === "shown" ? this.marked() : [];
    await Plotly.react(this.node, [this.trace(state, scale), ...marks], this.layout(room), config);
  }
  async turn(camera) {
    this.camera = camera;
    this.following = true; // its own events on the way say nothing new
    await Plotly.relayout(this.node, { "scene.camera": camera });
    this.following = false;
  }
  // What is under the pointer, in words. Plotly names a face, or a point where points are coloured.
  describe(index, onPoints) {
    const { a, b, c, owner, origin } = this.faces;
    const touches = (_, f) => a[f] === index || b[f] === index || c[f] === index;
    const face = onPoints ? owner.findIndex(touches) : index;
    const tet = owner[face];
    if (tet === undefined) return "";
    const said = [this.tets.names[this.tets.region[tet]]];
    for (const [name, values] of Object.entries(this.values)) {
      said.push(`${name === "von_mises" ? "stress" : MAPS[name].label} ${words(values[tet], MAPS[name])}`);
    }
    const corners = onPoints ? [index] : [a[face], b[face], c[face]];
    const moved = corners.reduce((sum, point) => sum + this.length(origin[point]), 0) / corners.length;
    if (this.moved) said.push(`moved ${words(moved, MAPS.moved)}`);
    return said.join("  ·  ");
  }
}
