// Time: play, pause, and the slider of frames.

const FRAME_PAUSE = 40; // milliseconds between drawn frames: plotly's own limit is about 25 a second

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
