// What can be shown on the mesh: label, unit, colours, and the scale under the view.

const DATA = JSON.parse(document.getElementById("data").textContent);
const PALETTES = DATA.palettes, PARTS = DATA.parts;

// `log`: decades on the scale; `shared`: several cases share one scale, so that they can be compared.
const MAPS = {
  part: { label: "Part" },
  E: { label: "E", long: "Young's modulus E", unit: "Pa", log: true, colors: PALETTES.E },
  nu: { label: "ν", long: "Poisson's ratio ν", unit: "", colors: PALETTES.nu },
  rho: { label: "ρ", long: "Density ρ", unit: "kg/m³", log: true, plain: true, colors: PALETTES.rho },
  moved: { label: "Displacement", long: "Displacement", unit: "m", colors: PALETTES.displacement, onPoints: true },
  swing: { label: "Amplitude", long: "Amplitude of the vibration as drawn: its size is free", unit: "m", colors: PALETTES.displacement, onPoints: true },
  von_mises: { label: "Stress", long: "Von Mises stress under load", unit: "Pa", log: true, colors: PALETTES.von_mises },
  look: { label: "As loaded" },
};
const STRESS_DECADES = 4; // stresses further below the largest look alike: nobody reads them

const MOST_PART_COLORS = 64; // of one map: plotly samples a colour map at 256 places; then colours repeat

function partColor(part) {
  const index = part % MOST_PART_COLORS;
  if (index < PARTS.length) return PARTS[index];
  return `hsl(${(index * 137.508) % 360}, 38%, 56%)`; // golden angle: neighbours differ
}

function rounded(value, digits = 3) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size >= 1e-3 && size < 1e6 ? String(Number(value.toPrecision(digits))) : value.toExponential(digits - 1);
}

const PREFIXES = { 9: "G", 6: "M", 3: "k", 0: "", "-3": "m", "-6": "µ", "-9": "n" };

// Power of ten of the SI prefix that suits a value; densities and numbers without a unit have none.
function powerOf(value, map) {
  if (!map.unit || map.plain || value === 0) return 0;
  return Math.min(9, Math.max(-9, 3 * Math.floor(Math.log10(Math.abs(value) * (1 + 1e-9)) / 3)));
}

function words(value, map, digits = 3) {
  const power = powerOf(value, map);
  return `${rounded(value / 10 ** power, digits)} ${PREFIXES[power]}${map.unit}`.trim();
}

class Scale {
  constructor(map, lo, hi) {
    this.map = map;
    if (map === MAPS.von_mises) lo = Math.max(lo, hi / 10 ** STRESS_DECADES);
    if (map.log && !(lo > 0)) lo = hi > 0 ? hi / 10 ** STRESS_DECADES : 1;
    if (map.log && !(hi > 0)) hi = 10 * lo;
    this.single = hi - lo <= 1e-6 * Math.abs(hi);
    if (this.single) [lo, hi] = map.log ? [lo / 2, hi * 2] : [lo - (Math.abs(lo) || 1) / 2, hi + (Math.abs(hi) || 1) / 2];
    this.log = Boolean(map.log) && hi / lo > 3;
    [this.lo, this.hi] = [lo, hi];
  }
  share(value) {
    const x = this.log
      ? Math.log(Math.max(value, this.lo) / this.lo) / Math.log(this.hi / this.lo)
      : (value - this.lo) / (this.hi - this.lo);
    return Math.min(1, Math.max(0, x));
  }
  get colorscale() {
    const last = this.map.colors.length - 1;
    return this.map.colors.map((color, i) => [i / last, color]);
  }
  // Values to write below a bar on which two words need `gap` of its length between them.
  ticks(gap) {
    if (this.single) return [this.log ? Math.sqrt(this.lo * this.hi) : this.map.log ? this.lo * 2 : (this.lo + this.hi) / 2];
    const apart = (t) => this.share(t) > gap && this.share(t) < 1 - gap;
    return [this.lo, ...(this.log ? this.decades(gap) : this.steps()).filter(apart), this.hi];
  }
  decades(gap) {
    const from = Math.ceil(Math.log10(this.lo) - 1e-9), to = Math.floor(Math.log10(this.hi) + 1e-9);
    const stride = Math.max(1, Math.ceil(gap * Math.log10(this.hi / this.lo)));
    const ticks = [];
    for (let p = from; p <= to; p += stride) ticks.push(10 ** p);
    return ticks;
  }
  steps() {
    const rough = (this.hi - this.lo) / 4, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
    const ticks = [];
    for (let t = Math.ceil(this.lo / step) * step; t < this.hi; t += step) ticks.push(t);
    return ticks;
  }
}

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key in node) node[key] = value;
    else node.setAttribute(key, value);
  }
  node.append(...children); // strings become text, never markup
  return node;
}

const WORD_WIDTH = 72; // pixels of "100 MPa" and some air

function drawScale(place, scale) {
  const bar = element("div", { className: "bar" });
  bar.style.background = `linear-gradient(90deg, ${scale.map.colors.join(", ")})`;
  const ticks = element("div", { className: "ticks" });
  for (const value of scale.ticks(WORD_WIDTH / Math.max(place.clientWidth, 4 * WORD_WIDTH))) {
    const share = scale.share(value);
    const tick = element("span", {}, words(value, scale.map));
    tick.className = share < 0.02 ? "start" : share > 0.98 ? "end" : "";
    tick.style.left = `${100 * share}%`;
    ticks.append(tick);
  }
  const name = scale.map.long + (scale.log ? ", logarithmic" : "");
  place.replaceChildren(element("p", { className: "scale-name" }, name), bar, ticks);
}
