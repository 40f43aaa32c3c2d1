// Choices, sliders and keys of the page, each a change of its state.

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
