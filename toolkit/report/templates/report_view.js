// One 3D view: a case drawn in the common state {map, shape, cut, factor, frame}.

// Axis order that puts the asset's up axis last, a rotation (no mirror): plotly turns about z.
const ORDER = { x: [1, 2, 0], y: [2, 0, 1], z: [0, 1, 2] };
function orderOf(up) {
  return ORDER[up.slice(-1)];
}
// By axis of the asset, the sign it is drawn with: -y up is a half turn about the second drawn axis.
function signsOf(up) {
  return [0, 1, 2].map((axis) => (up.startsWith("-") && axis !== orderOf(up)[1] ? -1 : 1));
}
// Plotly takes faces below an absolute size as flat: everything is drawn this many units long.
const DRAWN_SIZE = 100;
const LIGHT = { ambient: 0.5, diffuse: 0.55, specular: 0.05, roughness: 0.8, fresnel: 0.02 };
const AXES_SHARE = 0.2; // of the longest side: the axes, a round length
const SCALE_BELOW = 0.35; // of that length: their scale, written below the ends that are drawn lowest
const SWING_SHARE = 0.05, SWING_FRAMES = 24; // a vibration's size is free: this share of the diagonal
// The largest of 1, 2, 5, 10, 20 ... that is not above `most`.
function roundBelow(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return power * [5, 2, 1].find((m) => m * power <= most);
}

// A vibration has a size of its own, everything else the one that the slider says.
function factorOf(state) {
  return state.shape === "vibration" ? 1 : state.factor;
}

function inkColor() {
  return getComputedStyle(document.body).color;
}

function panelColor() {
  return getComputedStyle(document.body).backgroundColor;
}

class View {
  constructor(index, packed, tets, up) {
    this.index = index;
    this.node = document.getElementById(`plot${index}`);
    this.readout = document.getElementById(`readout${index}`);
    this.tets = tets;
    [this.order, this.signs] = [orderOf(up), signsOf(up)];
    this.values = {};
    for (const name of ["E", "nu", "rho", "von_mises"]) {
      if (packed[name]) this.values[name] = unpack(packed[name], Float32Array);
    }
    this.frames = {};
    for (const shape of ["displacement", "motion"]) {
      if (packed[shape]) this.frames[shape] = new Frames(packed[shape], tets.pointCount);
    }
    this.up = up;
    this.diagonal = Math.hypot(...tets.hi.map((h, i) => h - tets.lo[i]));
    this.vibrations = packed.vibrations || null; // of largest length 1 m each
    if (this.vibrations) this.swings = new Frames(this.vibrations, tets.pointCount);
    this.state = packed.state || "Under load";
    this.clock = packed.clock || "time";
    this.times = packed.times || [];
    const longest = Math.max(...tets.hi.map((h, i) => h - tets.lo[i]));
    this.zoom = DRAWN_SIZE / longest;
    this.marks = new Marks(packed.marks, ARROW_SHARE * longest, (rows) => this.placed(rows));
  }
  // Displacement [m] of all points in this state, or null at rest.
  displacement(state) {
    if (state.shape === "vibration") return this.swing(state);
    const frames = this.frames[state.shape];
    if (!frames) return null;
    return frames.at(state.shape === "motion" ? Math.min(state.frame, frames.count - 1) : 0);
  }
  swing({ mode, frame }) {
    if (!this.swings) return null;
    const size = SWING_SHARE * this.diagonal * Math.cos((2 * Math.PI * frame) / SWING_FRAMES);
    return this.swings.at(Math.min(mode, this.swings.count - 1)).map((u) => size * u);
  }
  // [smallest, largest] of what the map shows, over all frames for displacements.
  extent(name) {
    if (name === "moved") {
      return [0, Math.max(0, ...Object.values(this.frames).map((f) => f.largest()))];
    }
    if (name === "swing") return [0, SWING_SHARE * this.diagonal];
    const values = this.values[name];
    if (!values) return [Infinity, -Infinity];
    return [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
  }
  // Room [m] that the shape takes at rest and at the largest exaggeration.
  room(factor) {
    const lo = [...this.tets.lo], hi = [...this.tets.hi];
    const ways = Object.values(this.frames).map((frames) => [frames.reach(this.tets.points), factor]);
    if (this.swings) for (const sign of [-1, 1]) ways.push([this.swings.reach(this.tets.points), sign * SWING_SHARE * this.diagonal]);
    for (const [reach, size] of ways) {
      const [down, up] = reach(size);
      for (let axis = 0; axis < 3; axis += 1) {
        lo[axis] = Math.min(lo[axis], down[axis]);
        hi[axis] = Math.max(hi[axis], up[axis]);
      }
    }
    for (const place of [...this.axisEnds(), ...this.marks.places()]) {
      for (let axis = 0; axis < 3; axis += 1) {
        lo[axis] = Math.min(lo[axis], place[axis]);
        hi[axis] = Math.max(hi[axis], place[axis]);
      }
    }
    return [lo, hi];
  }
  trace(state, scale) {
    if (this.cut !== state.cut || this.hidden !== state.hidden || !this.faces) {
      this.faces = new Surface(this.tets, this.tets.shown(state.hidden), state.cut);
      [this.cut, this.hidden] = [state.cut, state.hidden];
    }
    this.moved = this.displacement(state);
    const { a, b, c } = this.faces;
    const [x, y, z] = this.order.map((axis) => this.coordinates(axis, factorOf(state)));
    const paint = scale ? this.paint(scale) : state.map === "look" ? this.paintLook() : this.paintParts();
    return { type: "mesh3d", x, y, z, i: a, j: b, k: c, hoverinfo: "none", flatshading: false,
      lighting: LIGHT, lightposition: { x: 1400, y: 400, z: 1500 }, showscale: false, ...paint };
  }
  // Beside the body, what the state asks for.
  extras(state) {
    const { shows } = state;
    return [
      ...(shows.marks ? this.marks.traces() : []),
      ...(shows.edges ? this.edges(state) : []),
      ...(shows.ghost && this.moved ? this.ghost() : []),
      ...(shows.axes ? this.axes() : []),
    ];
  }
  edges(state) {
    const ends = this.order.map((axis) => this.coordinates(axis, factorOf(state)));
    const [x, y, z] = ends.map((at) => this.faces.edges().flatMap(([p, q]) => [at[p], at[q], null]));
    return [{ type: "scatter3d", mode: "lines", line: { width: 1, color: "rgba(20,22,24,.55)" }, x, y, z, hoverinfo: "none", showlegend: false }];
  }
  // The body as it was.
  ghost() {
    const { a, b, c } = this.faces;
    const [x, y, z] = this.order.map((axis) => this.coordinates(axis, 0));
    return [{ type: "mesh3d", x, y, z, i: a, j: b, k: c, color: "#8b9096", opacity: 0.22, hoverinfo: "none" }];
  }
  // Where the axes start: at the lower corner of the body that is nearest to the first look.
  get corner() {
    const { lo, hi } = this.tets, corner = [...lo], [right, , up] = this.order;
    if (this.signs[right] > 0) corner[right] = hi[right];
    if (this.signs[up] < 0) corner[up] = hi[up];
    return { corner, length: roundBelow(AXES_SHARE * Math.max(...hi.map((h, i) => h - lo[i]))) };
  }
  // Ends of the three axes, and the place of their scale below all that is drawn of them.
  axisEnds() {
    const { corner, length } = this.corner, up = this.order[2], sign = this.signs[up];
    const ends = [0, 1, 2].map((axis) => corner.map((x, i) => x + (i === axis ? length : 0)));
    const depth = sign * (SCALE_BELOW + (sign < 0 ? 1 : 0)) * length;
    return [...ends, corner.map((x, i) => x - (i === up ? depth : 0))];
  }
  // Three axes of a round length: the scale of the drawing.
  axes() {
    const { corner, length } = this.corner, ends = this.axisEnds(), below = ends.pop();
    const text = ["x", "y", "z", words(length, MAPS.moved)];
    const textposition = [...ends.map(() => "top center"), "bottom center"];
    const font = { size: 12, color: inkColor() };
    return [
      { type: "scatter3d", mode: "lines", line: { width: 3, color: font.color }, ...this.placed(ends.flatMap((end) => [corner, end, null])) },
      { type: "scatter3d", mode: "text", text, textfont: font, textposition, ...this.placed([...ends, below]) },
    ];
  }
  // Where the map is largest: its value, the place at rest [m], the part, and a drawn point.
  peak({ map }) {
    if (map.onPoints ? !this.moved : map !== MAPS.von_mises || !this.values.von_mises) return null;
    const { tets } = this, values = map.onPoints ? null : this.values.von_mises;
    let best = 0, most = -Infinity;
    for (let i = 0; i < (values ? values.length : tets.pointCount); i += 1) {
      const value = values ? values[i] : Math.hypot(...this.moved.subarray(3 * i, 3 * i + 3));
      if (value > most) [best, most] = [i, value];
    }
    const tet = values ? best : tets.tets.indexOf(best) >> 2;
    const corners = values ? [0, 1, 2, 3].map((i) => tets.tets[4 * best + i]) : [best];
    const place = [0, 1, 2].map((i) => corners.reduce((sum, p) => sum + tets.points[3 * p + i], 0) / corners.length);
    return { value: most, place, part: tets.names[tets.region[tet]] };
  }
  // A flag on the drawn surface, as near to the largest value as it comes; it is never hidden.
  peakFlag(scale, state) {
    const peak = state.shows.largest && scale && this.peak(scale);
    if (!peak || !(peak.value > 0) || !this.faces.origin.length) return [];
    const rest = [0, 1, 2].map((axis) => this.faces.atRest(axis));
    const away = (k) => Math.hypot(...rest.map((x, i) => x[k] - peak.place[i]));
    let nearest = 0;
    for (let k = 1; k < rest[0].length; k += 1) if (away(k) < away(nearest)) nearest = k;
    const [x, y, z] = this.order.map((axis) => this.coordinates(axis, factorOf(state))[nearest]);
    const text = `largest: ${words(peak.value, scale.map)}`, color = inkColor();
    return [{ x, y, z, text, ax: 46, ay: -38, arrowcolor: color, arrowwidth: 1.5, arrowhead: 6, bgcolor: panelColor(), bordercolor: color, borderpad: 3, font: { size: 12, color } }];
  }
  placed(rows) {
    const [x, y, z] = this.order.map((axis) => rows.map((row) => (row === null ? null : this.zoom * this.signs[axis] * row[axis])));
    return { x, y, z, hoverinfo: "none", showlegend: false };
  }
  // Drawn coordinates of the surface along an axis of the mesh.
  coordinates(axis, factor) {
    const { points } = this.tets;
    const at = (point) => points[3 * point + axis] + (this.moved ? factor * this.moved[3 * point + axis] : 0);
    const { origin, other, share } = this.faces, zoom = this.zoom * this.signs[axis];
    return Float32Array.from(origin, (p, k) => zoom * ((1 - share[k]) * at(p) + share[k] * at(other[k])));
  }
  // How far [m] a point of the surface has moved.
  length(k) {
    if (!this.moved) return 0;
    const { origin, other, share } = this.faces;
    const along = (i) => (1 - share[k]) * this.moved[3 * origin[k] + i] + share[k] * this.moved[3 * other[k] + i];
    return Math.hypot(along(0), along(1), along(2));
  }
  paint(scale) {
    const shade = { colorscale: scale.colorscale, cmin: 0, cmax: 1 };
    if (scale.map.onPoints) {
      const intensity = Float32Array.from(this.faces.origin, (_, k) => scale.share(this.length(k)));
      return { ...shade, intensity, intensitymode: "vertex" };
    }
    const name = Object.keys(MAPS).find((one) => MAPS[one] === scale.map);
    const intensity = this.faces.owner.map((tet) => scale.share(this.values[name][tet]));
    return { ...shade, intensity, intensitymode: "cell" };
  }
  paintParts() {
    const count = Math.min(this.tets.names.length, MOST_PART_COLORS);
    const colors = Array.from({ length: count }, (_, i) => partColor(i));
    return this.banded(colors, (tet) => this.tets.region[tet] % count);
  }
  // As the asset looks; a cut shows the colour of the surface that is nearest.
  paintLook() {
    const { colors, index } = this.tets.look;
    return this.banded(colors, (tet) => index[tet]);
  }
  // Bands of one colour each, not `facecolor`: plotly would tint that with the map shown before.
  banded(colors, bandOf) {
    const count = colors.length;
    const colorscale = colors.flatMap((color, i) => [0, 1].map((end) => [(i + end) / count, color]));
    const intensity = this.faces.owner.map((tet) => (bandOf(tet) + 0.5) / count);
    return { colorscale, cmin: 0, cmax: 1, intensity, intensitymode: "cell" };
  }
  layout(room, annotations) {
    const range = this.range(room);
    const axis = (i) => ({ visible: false, range: range[i] });
    const size = range.map(([lo, hi]) => hi - lo || 1e-9);
    const most = Math.max(...size);
    return {
      margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", hovermode: "closest",
      scene: {
        xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), dragmode: "turntable",
        aspectmode: "manual", aspectratio: { x: size[0] / most, y: size[1] / most, z: size[2] / most },
        annotations, camera: this.camera || this.look(EYE, range),
      },
    };
  }
  // The camera that looks from a direction at all that is ever drawn.
  look(from, range) {
    return lookAt(from, range, this.node.clientWidth / this.node.clientHeight || 1);
  }
  // Range of the drawing along its three axes.
  range(room) {
    const drawn = (i) => room.map((end) => this.zoom * this.signs[i] * end[i]);
    return this.order.map((i) => drawn(i).sort((a, b) => a - b));
  }
  looks() {
    return { Start: EYE, ...(LOOKS[this.up.slice(-1)] || LOOKS.y) };
  }
  async draw(state, scale, room) {
    const config = { displayModeBar: false, responsive: true, scrollZoom: true };
    const traces = [this.trace(state, scale), ...this.extras(state)];
    await Plotly.react(this.node, traces, this.layout(room, this.peakFlag(scale, state)), config);
    this.resting = this.peakWords(scale);
    this.readout.textContent = this.resting;
  }
  // Where the map is largest, in words: what stands below the view until a pointer asks.
  peakWords(scale) {
    const peak = scale && this.peak(scale);
    if (!peak || !(peak.value > 0)) return "";
    const place = peak.place.map((x) => words(x, MAPS.moved)).join(", ");
    return `largest ${words(peak.value, scale.map)} in ${peak.part}, at (${place}) of the body at rest`;
  }
  async turn(camera) {
    this.camera = camera;
    this.following = true; // its own events on the way say nothing new
    await Plotly.relayout(this.node, { "scene.camera": camera });
    this.following = false;
  }
  // What is under the pointer, in words. Plotly names a face, or a point where points are coloured.
  describe(index, onPoints) {
    const { a, b, c, owner } = this.faces;
    const touches = (_, f) => a[f] === index || b[f] === index || c[f] === index;
    const face = onPoints ? owner.findIndex(touches) : index;
    const tet = owner[face];
    if (tet === undefined) return "";
    const said = [this.tets.names[this.tets.region[tet]]];
    for (const [name, values] of Object.entries(this.values)) {
      said.push(`${name === "von_mises" ? "stress" : MAPS[name].label} ${words(values[tet], MAPS[name])}`);
    }
    const corners = onPoints ? [index] : [a[face], b[face], c[face]];
    const moved = corners.reduce((sum, point) => sum + this.length(point), 0) / corners.length;
    if (this.moved) said.push(`moved ${words(moved, MAPS.moved)}`);
    return said.join("  ·  ");
  }
}
