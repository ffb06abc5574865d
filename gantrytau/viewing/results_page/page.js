// The page: runs, cursors, keys, and what is drawn at first.
"use strict";
(async () => {
  const $ = (id) => document.getElementById(id);
  try {
    await Data.ready;
  } catch (error) {
    $("panels").textContent = typeof DecompressionStream === "undefined"
      ? "This browser is too old for the page: it needs DecompressionStream (Chromium 80, Firefox 113, Safari 16.4 or newer)."
      : `The page is damaged: ${error}`;
    return;
  }

  function runs() {
    if (Data.runs.length < 2) return;
    Data.runs.forEach((run, k) => {
      const label = document.createElement("label"), tick = document.createElement("input");
      tick.type = "checkbox";
      tick.checked = true;
      tick.onchange = () => { run.shown = tick.checked; Panels.layout(); };
      const line = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      line.setAttribute("class", "swatch");
      line.innerHTML = `<line x1="0" x2="26" y1="5" y2="5" stroke="currentColor" stroke-width="2" stroke-dasharray="${Curves.dash(k).join(" ")}"/>`;
      label.append(tick, line, run.title);
      $("runs").append(label);
    });
  }

  // the states that stand highest, or else what moves
  function first() {
    const chosen = Data.first.map((name) => Data.variables.find((variable) => variable.name === name));
    if (chosen.length) return chosen;
    const names = new Set(Data.variables.map((variable) => variable.name));
    const moving = Data.variables.filter((variable) => !Data.isConstant(variable) && !variable.name.startsWith("der("));
    const states = moving.filter((variable) => names.has(`der(${variable.name})`));
    const depth = (variable) => variable.name.split(".").length;
    const sorted = (states.length ? states : moving).sort((one, other) => depth(one) - depth(other));
    return sorted.slice(0, 3);
  }

  const said = (name, time) => (time === null ? "" : `${name} = ${short(time, Panels.times())} s`);
  Panels.onChange = (time) => {
    const {a, b} = Panels, parts = [time === a ? "" : said("t", time), said("A", a), said("B", b)];
    if (a !== null && b !== null) parts.push(`B − A = ${short(b - a)} s`, b === a ? "" : `1/(B − A) = ${short(1 / (b - a))} Hz`);
    $("status").textContent = parts.filter(Boolean).join("   ");
  };
  Tree.ticked = Panels.shown;
  Tree.onTick = (variable) => Panels.toggle(variable);
  Tree.onX = (variable) => Panels.against(variable);

  const calls = {
    fit: Panels.fit, back: Panels.back, clear: Panels.clear,
    "new-panel": () => { Panels.add(); Panels.layout(); },
    variables: () => document.body.classList.toggle("tree-open"),
    csv: Export.csv, svg: Export.svg, png: Export.png,
  };
  for (const [id, call] of Object.entries(calls)) $(id).onclick = call;
  addEventListener("keydown", (event) => {
    if (event.target.type === "search" || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = {ArrowLeft: -1, ArrowRight: 1}[event.key], [low, high] = Panels.times();
    if (event.key === "f") Panels.fit();
    else if (event.key === "Backspace") Panels.back();
    else if (event.key === "Escape") { Panels.pin(null, "b"); Panels.pin(null, "a"); }
    else if (event.key === "/") $("search").focus();
    else if (step && Panels.a !== null) Panels.pin(Math.min(Math.max(Panels.a + (step * (high - low)) / (event.shiftKey ? 1000 : 100), low), high), "a");
    else return;
    event.preventDefault();
  });

  $("accuracy").textContent = `values to ${Number((2 ** -Data.bits).toPrecision(1))} of their range`;
  for (const run of Data.runs) if (run.ended !== "stop") $("accuracy").textContent += ` · ${run.title} ended: ${run.ended}`;
  runs();
  Scene.start($("scene"), $("show-scene"));
  Panels.start($("panels"), $("bands"));
  Tree.start($("tree"), $("search"));
  Panels.layout();
  for (const variable of first()) await Panels.toggle(variable);
  Panels.active = Panels.panels[0] || null;
  Panels.layout();
  document.body.dataset.ready = "yes";
})();
