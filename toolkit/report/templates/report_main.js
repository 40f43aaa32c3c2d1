// State, controls and keyboard of the page.

const SHARE_SHOWN = 0.15; // the largest exaggerated displacement, as a share of the diagonal
const MOST_IS_TRUE = 1.05; // motions this large need no exaggeration: the slider only weakens them
const AIR = 0.005; // of the longest side of what is drawn, around it
const FRAME_PAUSE = 40; // milliseconds between drawn frames: plotly's own limit is about 25 a second

class Report {
  constructor(data) {
    const geometries = data.geometries.map((packed) => new Tets(packed));
    this.views = data.cases.map((packed, i) => new View(i, packed, geometries[packed.geometry], data.up));
    this.motion = this.views.some((view) => view.frames.motion || view.swings);
    this.largest = this.extent("moved")[1];
    const diagonal = Math.max(...this.views.map(({ tets }) => Math.hypot(...tets.hi.map((h, i) => h - tets.lo[i]))));
    this.most = this.largest > 0 ? Math.max(1, (SHARE_SHOWN * diagonal) / this.largest) : 1;
    this.room = this.commonRoom();
    this.position = this.most <= MOST_IS_TRUE ? 100 : 70; // of the exaggeration's slider
    this.state = {
      map: "E", shape: this.firstShape(), cut: null, hidden: new Set(), mode: 0, frame: 0, ranges: {},
      shows: { marks: true, axes: true, largest: true, edges: false, ghost: false }, factor: this.factorAt(this.position),
    };
    this.cut = { axis: 0, share: 0.5, flip: false };
    this.playing = 0;
  }
  extent(name) {
    const all = this.views.map((view) => view.extent(name));
    return [Math.min(...all.map((e) => e[0])), Math.max(...all.map((e) => e[1]))];
  }
  commonRoom() {
    const rooms = this.views.map((view) => view.room(this.most));
    const fold = (side, pick) => [0, 1, 2].map((axis) => pick(...rooms.map((room) => room[side][axis])));
    const [lo, hi] = [fold(0, Math.min), fold(1, Math.max)];
    const air = AIR * Math.max(...hi.map((h, i) => h - lo[i])); // what lies on the border is drawn too
    return [lo.map((x) => x - air), hi.map((x) => x + air)];
  }
  // Exaggeration at a slider position 0..100: nothing at 0, then true scale to the most, in ratios.
  factorAt(position) {
    if (this.most <= MOST_IS_TRUE) return position / 100;
    return position < 1 ? 0 : this.most ** ((position - 1) / 99);
  }
  maps() {
    const known = (name) => name !== "swing" && this.knows(name);
    return Object.keys(MAPS).filter(known).map((name) => [name, MAPS[name].label]);
  }
  knows(name) {
    return name === "part" || (name === "moved" ? this.largest > 0 || this.views.some((view) => view.swings) : this.views.some((v) => v.values[name]));
  }
  shapes() {
    const { state, clock } = this.views[0];
    const all = [["rest", "At rest"], ["displacement", state], ["motion", clock === "load" ? "Loading" : "In motion"], ["vibration", "Vibration"]];
    const known = (name) => name === "rest" || this.views.some((view) => (name === "vibration" ? view.swings : view.frames[name]));
    return all.filter(([name]) => known(name));
  }
  // What moves is shown moving, what rests under a load is shown there.
  firstShape() {
    const names = this.shapes().map(([name]) => name);
    const moves = names.includes("motion") && this.views[0].clock === "time";
    return moves ? "motion" : names[1] || "rest";
  }
  // Times [s] of the frames of the shape; of a vibration, one period.
  times() {
    if (this.state.shape === "vibration") {
      const frequency = this.frequencies()[this.state.mode];
      return Array.from({ length: SWING_FRAMES + 1 }, (_, i) => i / SWING_FRAMES / frequency);
    }
    return this.views.map((view) => view.times).reduce((a, b) => (b.length > a.length ? b : a), []);
  }
  frequencies() {
    return this.views.map((view) => view.vibrations?.frequencies || []).reduce((a, b) => (b.length > a.length ? b : a), []);
  }
  // The scale of what is shown, within the range that a reader wants.
  scale() {
    const { map, shape, ranges } = this.state;
    if (map === "part") return null;
    const name = map === "moved" && shape === "vibration" ? "swing" : map;
    const [lo, hi] = this.extent(name), [low, high] = ranges[name] || [];
    return new Scale(MAPS[name], low ?? lo, high ?? hi);
  }
  async update(change = {}) {
    Object.assign(this.state, change);
    if (this.drawing) {
      this.stale = true; // the running draw picks the newest state up when it is done
      return this.drawing;
    }
    this.drawing = this.drawAll();
    return this.drawing;
  }
  async drawAll() {
    do {
      this.stale = false;
      const scale = this.scale();
      for (const view of this.views) await view.draw(this.state, scale, this.room);
      this.drawScale(scale);
    } while (this.stale);
    this.drawing = null;
  }
  drawScale(scale) {
    const place = document.getElementById("scale");
    if (scale) drawScale(place, scale);
    else place.replaceChildren(element("p", { className: "scale-name" }, "Coloured by part"));
  }
  setCut(change) {
    Object.assign(this.cut, change);
    const { axis, share, flip } = this.cut;
    if (axis < 0) return this.update({ cut: null });
    const { lo, hi } = this.views[0].tets;
    return this.update({ cut: { axis, at: lo[axis] + share * (hi[axis] - lo[axis]), flip } });
  }
  // All views look from a direction, at all that is ever drawn.
  lookFrom(name) {
    const [view] = this.views;
    const camera = view.look(view.looks()[name], view.range(this.room));
    return Promise.all(this.views.map((one) => one.turn(camera)));
  }
  // The others follow the view that is turned; while they do, only the newest camera is kept.
  async turnOthers(view, camera) {
    view.camera = camera;
    this.wanted = { view, camera };
    if (this.turning) return;
    this.turning = true;
    while (this.wanted) {
      const { view: leader, camera: newest } = this.wanted;
      this.wanted = null;
      await Promise.all(this.views.filter((other) => other !== leader).map((other) => other.turn(newest)));
    }
    this.turning = false;
  }
  // One camera for all views.
  linkCameras() {
    for (const view of this.views) {
      const follow = (event) => {
        if (event["scene.camera"] && !view.following) this.turnOthers(view, event["scene.camera"]);
      };
      view.node.on("plotly_relayout", follow);
      view.node.on("plotly_relayouting", follow);
      view.node.on("plotly_hover", (event) => {
        const onPoints = Boolean(this.scale()?.map.onPoints);
        view.readout.textContent = view.describe(event.points[0].pointNumber, onPoints);
      });
      view.node.on("plotly_unhover", () => { view.readout.textContent = view.resting; });
    }
  }
}

function choices(place, name, options, chosen, pick) {
  for (const [value, label] of options) {
    const input = element("input", { type: "radio", name, value, checked: value === chosen });
    input.addEventListener("change", () => pick(value));
    place.append(element("label", { className: "choice" }, input, element("span", {}, label)));
  }
  place.classList.toggle("alone", options.length < 2);
}

function slider(id, label, { min, max, step, value }, move) {
  const input = element("input", { type: "range", id });
  Object.assign(input, { min, max, step, value });
  const output = element("output", { htmlFor: id });
  const show = () => { output.textContent = move(Number(input.value)); };
  input.addEventListener("input", show);
  const row = element("div", { className: "slider" }, element("label", { htmlFor: id }, label), input, output);
  document.getElementById("sliders").append(row);
  return { row, input, output, show };
}

function pressed(name, value) {
  const input = document.querySelector(`input[name="${name}"][value="${value}"]`);
  if (input) input.click();
}

// Sliders move in steps from the keyboard shortcuts as they do from their own arrow keys.
function nudge(control, steps) {
  control.input.value = Number(control.input.value) + steps * Number(control.input.step);
  control.input.dispatchEvent(new Event("input"));
}

function build(report) {
  const at = (id) => document.getElementById(id);
  const { state } = report;
  choices(at("maps"), "map", report.maps(), state.map, (map) => { report.update({ map }); reveal(); });
  choices(at("shapes"), "shape", report.shapes(), state.shape, (shape) => { report.update({ shape }); reveal(); });
  choices(at("cut"), "cut", [["-1", "Off"], ["0", "x"], ["1", "y"], ["2", "z"]], "-1", (axis) => { report.setCut({ axis: Number(axis) }); reveal(); });
  switches(report);
  partChips(report);
  report.cut.axis = -1;
  const cut = slider("cut-at", "Cut at", { min: 0, max: 1, step: 0.01, value: 0.5 }, (share) => {
    report.setCut({ share });
    const { lo, hi } = report.views[0].tets, { axis } = report.cut;
    return axis < 0 ? "" : words(lo[axis] + share * (hi[axis] - lo[axis]), MAPS.moved);
  });
  const flip = element("button", { type: "button" }, "Other side");
  flip.addEventListener("click", () => report.setCut({ flip: !report.cut.flip }));
  cut.row.append(flip);
  const factor = slider("factor", "Exaggeration", { min: 0, max: 100, step: 1, value: report.position }, (position) => {
    report.update({ factor: report.factorAt(position) });
    return `× ${rounded(report.state.factor)}`;
  });
  const player = play(report);
  const modes = modePicker(report, () => reveal());
  const range = rangeFields(report);
  const tools = buildTools(report);
  function reveal() {
    const moving = ["motion", "vibration"].includes(state.shape);
    modes.hidden = state.shape !== "vibration";
    range.show();
    cut.row.hidden = report.cut.axis < 0;
    factor.row.hidden = ["rest", "vibration"].includes(state.shape);
    player.row.hidden = !moving;
    if (!moving) player.stop();
    player.retime();
    for (const control of [cut, factor]) if (!control.row.hidden) control.show();
  }
  tools.onReset = () => {
    pressed("cut", -1);
    document.querySelectorAll("#parts input:not(:checked)").forEach((box) => box.click());
    report.update({ ranges: {} });
    range.show();
    return report.lookFrom("Start");
  };
  reveal();
  keyboard(report, { cut, factor, player });
}

// Play and scrub: the clock follows the motion's own seconds, stretched to at least two.
function play(report) {
  const ofLoad = () => report.views[0].clock === "load" && report.state.shape === "motion";
  const control = slider("frame", "Time", { min: 0, max: 0, step: 1, value: 0 }, (frame) => {
    const times = report.times();
    report.update({ frame });
    if (!times.length) return "";
    return ofLoad() ? `${rounded(100 * times[frame])} % of the load` : words(times[frame], { unit: "s" });
  });
  const button = element("button", { type: "button", id: "play" }, "Play");
  let started = 0, timer = 0;
  const slow = (times) => Math.max(1, 2 / (times.at(-1) - times[0] || 1));
  const tick = async () => {
    const times = report.times(), length = times.at(-1) - times[0];
    const now = times[0] + ((performance.now() - started) / 1000 / slow(times)) % (length || 1);
    let frame = times.findIndex((time) => time > now);
    if (frame < 0) frame = times.length;
    control.input.value = Math.max(0, frame - 1);
    control.show();
    await report.update();
    if (timer) timer = setTimeout(tick, FRAME_PAUSE);
  };
  const stop = () => {
    clearTimeout(timer);
    timer = 0;
    button.textContent = "Play";
  };
  const toggle = () => {
    if (timer) return stop();
    const times = report.times();
    started = performance.now() - (times[Number(control.input.value)] - times[0]) * slow(times) * 1000;
    button.textContent = "Pause";
    timer = setTimeout(tick, 0);
  };
  button.addEventListener("click", toggle);
  control.row.append(button);
  // The frames of the shape that is shown now.
  const retime = () => {
    const last = Math.max(0, report.times().length - 1);
    control.input.max = last;
    if (report.state.frame > last) control.input.value = 0;
    control.row.firstChild.textContent = ofLoad() ? "Load" : "Time";
    if (!control.row.hidden) control.show();
  };
  return { ...control, stop, toggle, retime };
}

function keyboard(report, { cut, factor, player }) {
  const maps = report.maps();
  const keys = {
    x: () => pressed("cut", 0), y: () => pressed("cut", 1), z: () => pressed("cut", 2), o: () => pressed("cut", -1),
    "[": () => nudge(cut, -2), "]": () => nudge(cut, 2), "-": () => nudge(factor, -2), "+": () => nudge(factor, 2),
    "=": () => nudge(factor, 2), ",": () => nudge(player, -1), ".": () => nudge(player, 1),
    " ": () => { if (!player.row.hidden) player.toggle(); },
  };
  maps.forEach(([name], i) => { keys[String(i + 1)] = () => pressed("map", name); });
  document.addEventListener("keydown", (event) => {
    const typing = event.ctrlKey || event.metaKey || event.altKey;
    const action = keys[event.key];
    if (typing || !action || (event.key === " " && event.target.closest("button, input, summary"))) return;
    event.preventDefault();
    action();
  });
  const shown = [[`1 – ${maps.length}`, "colour"], ["x y z o", "cut"], ["[ ]", "move the cut"]];
  if (report.largest > 0) shown.push(["− +", "exaggeration"]);
  if (report.motion) shown.push(["space", "play"], [", .", "frame"]);
  const place = document.getElementById("keys");
  place.append("Keys  ");
  for (const [key, does] of shown) place.append(element("kbd", {}, key), ` ${does}   `);
}

function hasWebGL() {
  const canvas = document.createElement("canvas");
  return Boolean(canvas.getContext("webgl") || canvas.getContext("experimental-webgl"));
}

async function start() {
  startTouch();
  if (!hasWebGL()) {
    document.getElementById("viewer").append(
      element("p", { className: "notice" }, "This browser offers no WebGL, so the 3D view is not drawn. All numbers below are complete."),
    );
    document.querySelectorAll(".plot").forEach((node) => { node.hidden = true; });
    return;
  }
  const report = new Report(DATA);
  window.report = report;
  build(report);
  startDial(report);
  await report.update();
  report.linkCameras();
  document.body.dataset.ready = "yes";
}

start();
