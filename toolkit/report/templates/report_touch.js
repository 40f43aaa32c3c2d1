// Bodies that the reader pulls: a canvas a case, pointers, and the steps of a reduced body.

const FRAME = 1 / 60; // seconds of the reader between steps
const FIRMNESS = 5; // stiffness of the hand's spring over that of the body under it
const REACH = 0.5; // of the diagonal: the hand pulls no further
const QUIET = 1e-4; // of the diagonal: a body that moves less in a frame, and is not held, rests
const KEPT_TIMES = 240; // frames whose times are remembered
const TURN = 0.008; // radians a pixel
const VERTEX = `#version 300 es
in vec3 place; in vec3 color; uniform mat4 camera; out vec3 at; out vec3 shade;
void main() { at = place; shade = color; gl_Position = camera * vec4(place, 1.0); }`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at; in vec3 shade; uniform vec3 light; out vec4 seen;
void main() {
  vec3 n = normalize(cross(dFdx(at), dFdy(at)));
  seen = vec4(shade * (0.55 + 0.5 * max(dot(n, light), 0.0)), 1.0);
}`;

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const plus = (a, b, t = 1) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
const across = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const size = Math.hypot(...a) || 1; return a.map((x) => x / size); };

// Red, green, blue of a CSS colour, 0 to 1.
function channels(color) {
  const pen = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  pen.fillStyle = color;
  pen.fillRect(0, 0, 1, 1);
  return [...pen.getImageData(0, 0, 1, 1).data.slice(0, 3)].map((x) => x / 255);
}

// A camera on a ball around the middle, looking at it.
class Orbit {
  constructor(middle, radius, up) {
    Object.assign(this, { middle, radius, order: orderOf(up), signs: signsOf(up), side: 0.64, lift: 0.4, away: 2.9 * radius, aspect: 1 });
  }
  // Axis of the asset that is drawn as axis `k`, of which the last points up.
  along(k) {
    return [0, 1, 2].map((axis) => (axis === this.order[k] ? this.signs[axis] : 0));
  }
  frame() {
    const level = plus(this.along(0).map((x) => x * Math.cos(this.side)), this.along(1), Math.sin(this.side));
    const back = plus(level.map((x) => x * Math.cos(this.lift)), this.along(2), Math.sin(this.lift));
    const right = unit(across(this.along(2), back));
    return { back, right, up: across(back, right), eye: plus(this.middle, back, this.away) };
  }
  matrix() {
    const { back, right, up, eye } = this.frame();
    const f = 1 / Math.tan(Math.PI / 8), near = 0.02 * this.away, far = this.away + 4 * this.radius;
    const wide = Math.min(1, this.aspect), rows = [[right, (f * wide) / this.aspect], [up, f * wide]];
    const depth = (far + near) / (near - far), shift = (2 * far * near) / (near - far);
    const out = new Float32Array(16);
    rows.forEach(([axis, scale], r) => { for (let c = 0; c < 4; c += 1) out[4 * c + r] = scale * (c < 3 ? axis[c] : -dot(axis, eye)); });
    for (let c = 0; c < 4; c += 1) {
      const z = c < 3 ? back[c] : -dot(back, eye);
      out[4 * c + 2] = depth * z + (c === 3 ? shift : 0);
      out[4 * c + 3] = -z;
    }
    return out;
  }
  // Ray through a place of the canvas, both coordinates from -1 to 1.
  ray(x, y) {
    const { back, right, up, eye } = this.frame(), wide = Math.min(1, this.aspect), t = Math.tan(Math.PI / 8) / wide;
    return { eye, way: unit(plus(plus(back.map((b) => -b), right, x * t * this.aspect), up, y * t)) };
  }
}

class Touch {
  constructor(index, packed, up) {
    this.canvas = document.getElementById(`touch${index}`);
    this.readout = document.getElementById(`pull${index}`);
    this.body = new ReducedBody(packed);
    this.points = unpack(packed.points, Float32Array);
    this.faces = unpack(packed.faces, Uint32Array);
    this.steps = unpack(packed.basis, Int16Array);
    this.scales = Float64Array.from(packed.scales);
    this.magnification = packed.magnification;
    this.dt = FRAME / packed.slowness;
    this.drawn = Float32Array.from(this.points);
    this.times = [];
    this.stopped = false; // whether the last step failed
    this.pointers = new Map();
    this.measure();
    this.orbit = new Orbit(this.middle, this.size / 2, up);
    this.prepare(packed.region);
    this.listen();
    this.show();
  }
  measure() {
    const lo = [Infinity, Infinity, Infinity], hi = [-Infinity, -Infinity, -Infinity];
    this.points.forEach((x, i) => { lo[i % 3] = Math.min(lo[i % 3], x); hi[i % 3] = Math.max(hi[i % 3], x); });
    this.middle = plus(lo, hi).map((x) => x / 2);
    this.size = Math.hypot(...minus(hi, lo));
  }
  prepare(regions) {
    const gl = this.gl = this.canvas.getContext("webgl2", { antialias: true, alpha: true });
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    this.camera = gl.getUniformLocation(program, "camera");
    this.light = gl.getUniformLocation(program, "light");
    const color = new Map(), shades = new Float32Array(this.points.length);
    unpack(regions, Uint32Array).forEach((part, i) => {
      if (!color.has(part)) color.set(part, channels(partColor(part)));
      shades.set(color.get(part), 3 * i);
    });
    const fill = (name, data, use) => {
      const buffer = gl.createBuffer(), at = gl.getAttribLocation(program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data, use);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, 3, gl.FLOAT, false, 0, 0);
      return buffer;
    };
    fill("color", shades, gl.STATIC_DRAW);
    this.places = fill("place", this.drawn, gl.DYNAMIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.faces, gl.STATIC_DRAW);
    gl.enable(gl.DEPTH_TEST);
  }
  // Drawn places: at rest and the magnified displacement.
  skin() {
    const { dofs: n, q } = this.body, { steps, drawn, points } = this;
    const share = q.map((x, a) => x * this.scales[a] * this.magnification);
    for (let i = 0; i < drawn.length; i += 1) {
      let sum = points[i];
      for (let a = 0; a < n; a += 1) sum += steps[i * n + a] * share[a];
      drawn[i] = sum;
    }
  }
  show() {
    const { gl, canvas, orbit } = this, ratio = window.devicePixelRatio || 1;
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    orbit.aspect = wide / high;
    gl.viewport(0, 0, wide, high);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.places);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, this.drawn);
    gl.uniformMatrix4fv(this.camera, false, orbit.matrix());
    const { back, up, right } = orbit.frame();
    gl.uniform3fv(this.light, unit(plus(plus(back, up, 0.7), right, 0.4)));
    gl.drawElements(gl.TRIANGLES, this.faces.length, gl.UNSIGNED_INT, 0);
  }
  run() {
    if (this.running) return;
    this.running = true;
    let last = performance.now(), owed = 0;
    const frame = (now) => {
      owed = Math.min(owed + (now - last) / 1000, 2 * FRAME);
      last = now;
      const started = performance.now();
      for (; owed >= FRAME * 0.999; owed -= FRAME) this.stopped = !this.body.step(this.dt);
      this.skin();
      this.show();
      this.tell();
      this.times.push(performance.now() - started);
      if (this.times.length > KEPT_TIMES) this.times.shift();
      this.running = Boolean(this.body.grip) || this.moves();
      if (this.running) requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }
  moves() {
    const { q, v, dofs: n } = this.body;
    let most = 0;
    for (let a = 0; a < n; a += 1) most = Math.max(most, (Math.abs(q[a]) + Math.abs(v[a]) * this.dt) * this.scales[a] * 32767);
    return most * this.magnification > QUIET * this.size;
  }
  tell() {
    const { grip } = this.body;
    if (!grip) { this.readout.textContent = ""; return; }
    const u = this.body.displacement(grip.rows), force = grip.stiffness * Math.hypot(...minus(grip.target, u));
    const stopped = this.stopped ? "; too hard a pull for the page: no step was found, it was stopped" : "";
    this.readout.textContent = `pulled with ${words(force, { unit: "N" })}, moved ${words(Math.hypot(...u), MAPS.moved)}${stopped}`;
  }
  // Nearest face under a ray: its corners with the weights of the place, and the place.
  pick({ eye, way }) {
    const at = (i) => [0, 1, 2].map((k) => this.drawn[3 * i + k]);
    let best = null;
    for (let f = 0; f < this.faces.length; f += 3) {
      const corners = [...this.faces.subarray(f, f + 3)], [a, b, c] = corners.map(at), p = minus(b, a), r = minus(c, a);
      const h = across(way, r), det = dot(p, h), s = minus(eye, a), x = dot(s, h) / det, k = across(s, p), y = dot(way, k) / det;
      const far = dot(r, k) / det;
      if (Math.abs(det) > 0 && x >= 0 && y >= 0 && x + y <= 1 && far > 0 && !(best && best.far <= far)) {
        best = { far, corners, weights: [1 - x - y, x, y], place: plus(eye, way, far) };
      }
    }
    return best;
  }
  // Take hold of a place of the surface.
  grab({ corners, weights, place }) {
    const n = this.body.dofs;
    const rows = [0, 1, 2].map((axis) => Float64Array.from({ length: n }, (_, a) =>
      corners.reduce((sum, i, c) => sum + weights[c] * this.steps[(3 * i + axis) * n + a], 0) * this.scales[a]));
    const compliance = this.body.compliance(rows);
    if (!(compliance > 0)) return false; // it is held here
    const u = this.body.displacement(rows);
    this.body.grip = { rows, target: u, stiffness: FIRMNESS / compliance };
    this.held = { place, rest: minus(place, u.map((x) => x * this.magnification)), back: this.orbit.frame().back };
    this.run();
    return true;
  }
  // Pull to where a ray meets the plane through the held place that faces the reader.
  drag({ eye, way }) {
    const { place, rest, back } = this.held;
    const far = dot(minus(place, eye), back) / dot(way, back);
    const pull = minus(plus(eye, way, far), rest), size = Math.hypot(...pull), most = REACH * this.size;
    this.body.grip.target = pull.map((x) => (x * Math.min(1, most / (size || 1))) / this.magnification);
    this.run();
  }
  release() {
    this.body.grip = null;
    this.held = null;
    this.run();
  }
  stiffen(factor) {
    this.body.stiffness = factor;
    this.run();
  }
  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return this.orbit.ray((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
  }
  listen() {
    const { canvas, pointers } = this;
    const pointed = (event) => { pointers.set(event.pointerId, [event.clientX, event.clientY]); };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      const found = pointers.size === 0 ? this.pick(this.place(event)) : null;
      pointed(event);
      if (found && this.grab(found)) this.hand = event.pointerId;
      event.preventDefault();
    });
    canvas.addEventListener("pointermove", (event) => {
      const was = pointers.get(event.pointerId);
      if (!was) return;
      if (this.held) { if (event.pointerId === this.hand) this.drag(this.place(event)); }
      else this.move(event, was);
      pointed(event);
    });
    const gone = (event) => {
      pointers.delete(event.pointerId);
      if (this.held && event.pointerId === this.hand) this.release();
    };
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, gone);
    canvas.addEventListener("wheel", (event) => { this.zoomBy(Math.exp(0.001 * event.deltaY)); event.preventDefault(); }, { passive: false });
    new ResizeObserver(() => this.show()).observe(canvas);
  }
  // One pointer on the ground turns; two come together or part.
  move(event, was) {
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    const now = [event.clientX, event.clientY];
    if (others.length) {
      const apart = (p) => Math.hypot(p[0] - others[0][0], p[1] - others[0][1]) || 1;
      this.zoomBy(apart(was) / apart(now));
      return;
    }
    this.orbit.side -= TURN * (now[0] - was[0]);
    this.orbit.lift = Math.min(1.5, Math.max(-1.5, this.orbit.lift + TURN * (now[1] - was[1])));
    this.show();
  }
  zoomBy(factor) {
    this.orbit.away = Math.min(8 * this.size, Math.max(0.6 * this.size, this.orbit.away * factor));
    this.show();
  }
}

// All cases that can be pulled, and one slider of stiffness for them.
function startTouch() {
  window.touches = [];
  const section = document.getElementById("touch");
  if (!section) return;
  if (!document.createElement("canvas").getContext("webgl2")) {
    section.append(element("p", { className: "notice" }, "This browser offers no WebGL 2: the body cannot be pulled."));
    section.querySelectorAll("canvas").forEach((node) => { node.hidden = true; });
    return;
  }
  DATA.cases.forEach((packed, i) => { if (packed.touch) window.touches.push(new Touch(i, packed.touch, DATA.up)); });
  const input = document.getElementById("alpha"), output = document.querySelector("output[for=alpha]");
  const move = () => {
    const factor = 10 ** (2 * Number(input.value) - 1);
    output.textContent = `E × ${rounded(factor, 2)}`;
    for (const touch of window.touches) touch.stiffen(factor);
  };
  input.addEventListener("input", move);
  move();
}
