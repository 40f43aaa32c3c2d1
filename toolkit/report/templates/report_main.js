// The state of the page, which all its views draw, and its start.

const SHARE_SHOWN = 0.15; // the largest exaggerated displacement, as a share of the diagonal
const MOST_IS_TRUE = 1.05; // motions this large need no exaggeration: the slider only weakens them
const AIR = 0.005; // of the longest side of what is drawn, around it

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
    if (name === "look") return this.views.some((view) => view.tets.look);
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
    if (["part", "look"].includes(map)) return null;
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
    else place.replaceChildren(element("p", { className: "scale-name" }, this.state.map === "look" ? "The colours of the asset" : "Coloured by part"));
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
