// The dial from soft to stiff: E of every part at its place, and the nearest of the motions.

class Dial {
  // `cases` of one text or several, those of a text in the order of their alpha.
  constructor(report, cases) {
    this.report = report;
    this.cases = cases;
    this.alphas = [...new Set(cases.map(({ alpha }) => alpha))].sort((a, b) => a - b);
  }
  nearest(alpha) {
    const apart = (known) => Math.abs(known - alpha);
    return this.alphas.reduce((a, b) => (apart(b) < apart(a) ? b : a));
  }
  // E [Pa] of every part of a text: log E is even between the places that are known.
  stiffness(text, alpha) {
    const known = this.cases.filter((one) => one.text === text);
    const next = Math.max(1, known.findIndex((one) => one.alpha >= alpha));
    const [low, high] = [known[next - 1], known[next]];
    const share = (alpha - low.alpha) / (high.alpha - low.alpha);
    return low.E.map((E, part) => E ** (1 - share) * high.E[part] ** share);
  }
  // Show the cases of one alpha, or all of them where none is given.
  async show(alpha = null) {
    const shown = alpha === null ? null : this.nearest(alpha);
    this.report.views.forEach((view, i) => {
      view.node.closest(".case").hidden = shown !== null && this.cases[i].alpha !== shown;
    });
    await Promise.all(this.report.views.map((view) => !view.node.closest(".case").hidden && Plotly.Plots.resize(view.node)));
  }
  words(alpha) {
    const texts = [...new Set(this.cases.map(({ text }) => text))];
    const said = (text) => this.stiffness(text, alpha).map((E, part) => `${this.cases[0].parts[part]} ${words(E, MAPS.E)}`).join(", ");
    return `α = ${alpha.toFixed(2)}: ${texts.map(said).join(" | ")}; shown: α = ${this.nearest(alpha)}`;
  }
}

// The slider, where there are motions to switch among.
function startDial(report) {
  const cases = DATA.cases.map(({ dial }) => dial);
  if (!cases.every(Boolean)) return;
  const dial = new Dial(report, cases);
  let turned = false; // all beside each other until a reader turns it
  const control = slider("dial", "Soft to stiff α", { min: 0, max: 1, step: 0.01, value: 0.5 }, (alpha) => {
    if (turned) dial.show(alpha);
    return dial.words(alpha);
  });
  control.input.addEventListener("input", () => { turned = true; control.show(); });
  const all = element("button", { type: "button" }, "Side by side");
  all.addEventListener("click", () => { turned = false; dial.show(); });
  control.row.append(all);
  control.show();
  window.dial = dial;
}
