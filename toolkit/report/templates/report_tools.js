// Everything around the view: what is shown beside the body, its parts, looks, modes, files.

const SWITCHES = { marks: "Supports and loads", axes: "Axes", largest: "Largest value", edges: "Mesh", ghost: "Unloaded shape" };

function tick(label, checked, change) {
  const input = element("input", { type: "checkbox", checked });
  input.addEventListener("change", () => change(input.checked));
  return element("label", { className: "tick" }, input, ...[label].flat());
}

function switches(report) {
  const place = document.getElementById("shows");
  const drawn = report.views.some((view) => view.marks.traces().length);
  const known = { marks: drawn, axes: true, largest: true, edges: true, ghost: report.shapes().length > 1 };
  for (const [name, label] of Object.entries(SWITCHES)) {
    if (!known[name]) continue;
    place.append(tick(label, report.state.shows[name], (on) => report.update({ shows: { ...report.state.shows, [name]: on } })));
  }
}

// A chip a part: its colour, and whether it is drawn.
function partChips(report) {
  const place = document.getElementById("parts");
  const names = [...new Set(report.views.flatMap((view) => view.tets.names))];
  names.forEach((name, index) => {
    const swatch = element("i");
    swatch.style.background = partColor(index);
    const change = (on) => {
      const hidden = new Set(report.state.hidden);
      if (on) hidden.delete(name);
      else hidden.add(name);
      report.update({ hidden });
    };
    place.append(tick([swatch, name], true, change));
  });
}

// Every natural frequency; its shape is drawn, swinging.
function modePicker(report, changed) {
  const place = document.getElementById("modes");
  const select = element("select", { id: "mode" });
  report.frequencies().forEach((frequency, i) => {
    const said = report.views.map((view) => view.vibrations?.frequencies[i]).filter(Boolean).map((f) => words(f, { unit: "Hz" }));
    select.append(element("option", { value: i }, `${i + 1}: ${said.join(" | ")}`));
  });
  select.addEventListener("change", () => { report.update({ mode: Number(select.value) }); changed(); });
  place.append(element("label", { htmlFor: "mode" }, "Vibration"), select);
  return place;
}

// Lowest and highest value of the colours, as a reader wants them, in the unit that suits the highest.
function rangeFields(report) {
  const place = document.getElementById("range");
  const [low, high] = ["Colours from", "to"].map((label) => {
    const input = element("input", { type: "number", step: "any" });
    place.append(element("label", {}, label, input));
    return input;
  });
  const unit = element("span");
  place.append(unit);
  let power = 0; // of ten: of the unit that is shown
  const name = () => Object.keys(MAPS).find((one) => MAPS[one] === report.scale()?.map);
  const show = () => {
    const scale = report.scale();
    place.hidden = !scale;
    if (!scale) return;
    power = powerOf(scale.hi, scale.map);
    [low.value, high.value] = [scale.lo, scale.hi].map((x) => Number((x / 10 ** power).toPrecision(4)));
    unit.textContent = PREFIXES[power] + scale.map.unit;
  };
  const change = () => {
    const [lo, hi] = [low, high].map((input) => Number(input.value) * 10 ** power);
    if (hi > lo) report.update({ ranges: { ...report.state.ranges, [name()]: [lo, hi] } });
    show();
  };
  for (const input of [low, high]) input.addEventListener("change", change);
  return { show };
}

function save(name, content, type) {
  const url = content.startsWith("data:") ? content : URL.createObjectURL(new Blob([content], { type }));
  const link = element("a", { href: url, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

function fileName(report, view, ending) {
  const plain = document.querySelector("h1").textContent.replace(/[^\w.-]+/g, "_");
  return report.views.length > 1 ? `${plain}_${"ABCDEFGH"[view.index] || view.index}${ending}` : plain + ending;
}

const columns = (array, wide) => Array.from({ length: array.length / wide }, (_, i) => array.subarray(wide * i, wide * (i + 1)).join(" ")).join("\n");

// The mesh with its fields as a legacy VTK file, which ParaView, meshio and PyVista read.
function vtk(view) {
  const { tets, values, frames } = view;
  const cells = Array.from({ length: tets.count }, (_, t) => `4 ${tets.tets.subarray(4 * t, 4 * t + 4).join(" ")}`);
  const lines = ["# vtk DataFile Version 3.0", "autophyx-tet: m, Pa, kg/m3", "ASCII", "DATASET UNSTRUCTURED_GRID",
    `POINTS ${tets.pointCount} float`, columns(tets.points, 3), `CELLS ${tets.count} ${5 * tets.count}`, ...cells,
    `CELL_TYPES ${tets.count}`, ...cells.map(() => "10"), `CELL_DATA ${tets.count}`,
    "SCALARS region int 1", "LOOKUP_TABLE default", columns(tets.region, 1)];
  for (const [name, array] of Object.entries(values)) lines.push(`SCALARS ${name} float 1`, "LOOKUP_TABLE default", columns(array, 1));
  if (frames.displacement) lines.push(`POINT_DATA ${tets.pointCount}`, "VECTORS displacement float", columns(frames.displacement.at(0), 3));
  return `${lines.join("\n")}\n`;
}

const quoted = (text) => `"${String(text).replace(/"/g, '""')}"`;

// A row a tet: its part, centroid [m] and values.
function fieldCsv(view) {
  const { tets, values } = view, names = Object.keys(values);
  const rows = Array.from({ length: tets.count }, (_, t) => {
    const corners = [0, 1, 2, 3].map((i) => tets.tets[4 * t + i]);
    const middle = [0, 1, 2].map((i) => corners.reduce((sum, p) => sum + tets.points[3 * p + i], 0) / 4);
    return [quoted(tets.names[tets.region[t]]), ...middle, ...names.map((name) => values[name][t])].join(",");
  });
  return `part,x,y,z,${names.join(",")}\n${rows.join("\n")}\n`;
}

function tableCsv() {
  const rows = document.querySelectorAll("#materials tr");
  const cells = (row) => [...row.children].map((cell) => quoted(cell.innerText.replace(/\s+/g, " ").trim()));
  return [...rows].map((row) => cells(row).join(",")).join("\n") + "\n";
}

async function picture(report, view) {
  const { clientWidth: width, clientHeight: height } = view.node;
  const url = await Plotly.toImage(view.node, { format: "png", width, height, scale: 2 });
  save(fileName(report, view, ".png"), url);
}

// Looks, the whole screen, and files, as buttons.
function buildTools(report) {
  const button = (place, label, act) => {
    const made = element("button", { type: "button" }, label);
    made.addEventListener("click", act);
    document.getElementById(place).append(made);
  };
  const each = (write, ending, type) => () => report.views.forEach((view) => save(fileName(report, view, ending), write(view), type));
  const handlers = { onReset: () => {} };
  for (const name of Object.keys(report.views[0].looks()).slice(1)) button("looks", name, () => report.lookFrom(name));
  button("looks", "Reset", () => handlers.onReset());
  const viewer = document.getElementById("viewer");
  if (viewer.requestFullscreen) button("looks", "Whole screen", () => (document.fullscreenElement ? document.exitFullscreen() : viewer.requestFullscreen()));
  button("files", "Picture .png", () => report.views.forEach((view) => picture(report, view)));
  button("files", "Mesh .vtk", each(vtk, ".vtk", "text/plain"));
  button("files", "Field .csv", each(fieldCsv, "_field.csv", "text/csv"));
  if (document.querySelector("#materials tbody tr")) button("files", "Materials .csv", () => save(fileName(report, { index: 0 }, "_materials.csv"), tableCsv(), "text/csv"));
  return handlers;
}
