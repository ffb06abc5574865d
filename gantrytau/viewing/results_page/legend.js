// What stands above a panel: its variables with values at the cursor; and the strips of bands of modes.
"use strict";
const Legend = (() => {
  const self = {};

  function make(tag, className, text = "", title = "") {
    const element = document.createElement(tag);
    Object.assign(element, {className, textContent: text, title});
    return element;
  }
  function button(text, title, call) {
    const made = make("button", "small", text, title);
    made.setAttribute("aria-label", title);
    made.onclick = (event) => { event.stopPropagation(); call(); };
    return made;
  }

  function swatch(curve) {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("class", "swatch");
    svg.innerHTML = `<line x1="0" x2="26" y1="5" y2="5" stroke="${Curves.colour(curve.hue)}" stroke-width="2.5" stroke-dasharray="${curve.dash.join(" ")}"/>`;
    return svg;
  }

  function entry(panel, curve) {
    const {variable} = curve, item = make("span", "entry");
    item.title = variable.words ? `${variable.name}: ${variable.words}` : variable.name;
    const run = Data.runs.length > 1 ? make("span", "dim", Data.runs[curve.run].title) : "";
    curve.reading = make("span", "reading");
    item.append(swatch(curve), make("span", "name", variable.name), run, curve.reading);
    if (variable.beyond) item.append(make("span", "beyond", "⚠", variable.beyond.join("\n")));
    if (panel.variables.length > 1) item.append(button("⇣", `${variable.name} in a panel of its own`, () => Panels.own(variable, panel)));
    item.append(button("×", `remove ${variable.name}`, () => Panels.remove(variable, panel)));
    return item;
  }

  const inUnit = (unit) => (unit && unit !== "1" ? `[${unit}]` : "");

  self.panel = (panel) => {
    const frame = make("div", "panel" + (panel === Panels.active && Panels.panels.length > 1 ? " active" : ""));
    const top = make("div", "legend"), room = make("div", "room");
    top.append(make("span", "unit", inUnit(panel.variables[0]?.unit)));
    for (const curve of Panels.curvesOf(panel)) top.append(entry(panel, curve));
    if (!panel.variables.length) top.append(make("span", "dim", "tick a variable to draw it here"));
    const below = make("div", "below", panel.x ? `${panel.x.name} ${inUnit(panel.x.unit)}` : "time [s]");
    if (panel.x) below.append(button("time", "draw against time again", () => { Panels.active = panel; Panels.against(panel.x); }));
    frame.append(top, room, below);
    frame.addEventListener("pointerdown", () => {
      Panels.active = panel;
      for (const other of Panels.panels) other.frame.classList.toggle("active", other === panel && Panels.panels.length > 1);
    });
    panel.frame = frame;
    return {frame, room};
  };

  self.band = (band) => band.curves.filter((curve) => Data.runs[curve.run].shown).map((curve) => {
    const line = make("div", "band"), top = make("div", "legend"), {variable} = band;
    curve.reading = make("span", "reading");
    const run = Data.runs.length > 1 ? make("span", "dim", Data.runs[curve.run].title) : "";
    const shade = button(band.shade ? "▒" : "░", "shade the panels by this", () => {
      for (const other of Panels.bands) other.shade = other === band && !band.shade;
      Panels.layout();
    });
    shade.setAttribute("aria-pressed", Boolean(band.shade));
    const drawn = button("∿", "draw it as a curve", async () => { await Panels.remove(variable); Panels.toggle(variable, true); });
    top.append(make("span", "name", variable.name), run, curve.reading, shade, drawn,
      button("×", `remove ${variable.name}`, () => Panels.remove(variable)));
    top.title = variable.words || variable.name;
    curve.canvas = make("canvas", "stretches");
    curve.canvas.onclick = (event) => {
      const [low, high] = Panels.times(), at = curve.canvas.getBoundingClientRect();
      Panels.pin(low + ((event.clientX - at.left) / at.width) * (high - low), event.shiftKey ? "b" : "a");
    };
    line.append(top, curve.canvas);
    return line;
  });

  self.paintBand = (band, curve, [low, high]) => {
    const {canvas} = curve;
    if (!canvas?.clientWidth) return;
    const ratio = devicePixelRatio, width = canvas.clientWidth, height = canvas.clientHeight;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    const ctx = canvas.getContext("2d"), X = (time) => ((time - low) / (high - low)) * width;
    ctx.scale(ratio, ratio);
    ctx.font = "11px system-ui, sans-serif";
    ctx.textBaseline = "middle";
    for (const [begin, end, value] of Curves.stretches(curve, low, high)) {
      const from = Math.max(X(begin), 0), to = Math.min(X(end), width), word = Curves.word(band.variable, value);
      ctx.globalAlpha = value === 0 ? 0.12 : 0.45;
      ctx.fillStyle = Curves.band(value);
      ctx.fillRect(from, 0, Math.max(to - from, 1), height);
      ctx.globalAlpha = 1;
      ctx.fillStyle = getComputedStyle(canvas).color;
      if (ctx.measureText(word).width < to - from - 6) ctx.fillText(word, from + 4, height / 2 + 1);
    }
  };
  return self;
})();
