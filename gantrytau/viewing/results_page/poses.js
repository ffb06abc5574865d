// Sliders that put a model into poses: each choice of them is one picture of the film in the frame.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent), $ = (id) => document.getElementById(id);
  const failed = new Set(data.failed), reasons = Object.entries(data.reasons).map(([k, words]) => [Number(k), words]);
  const count = data.sliders.reduce((product, slider) => product * slider.values.length, 1);
  const places = data.sliders.map((slider) => slider.start), inputs = [], values = [];
  let assembly = 0;

  const number = () => data.sliders.reduce((k, slider, i) => k * slider.values.length + places[i], 0) + assembly * count;
  const spelled = (x, unit) => `${Number(x.toPrecision(4))}${unit && unit !== "1" ? " " + unit : ""}`;
  const nearest = (k) => reasons.reduce((best, one) => (Math.abs(one[0] - k) < Math.abs(best[0] - k) ? one : best))[1];

  function show() {
    const k = number(), wrong = failed.has(k);
    data.sliders.forEach((slider, i) => {
      inputs[i].value = places[i];
      values[i].textContent = spelled(slider.values[places[i]], slider.unit);
      inputs[i].setAttribute("aria-valuetext", values[i].textContent);
    });
    $("sliders").classList.toggle("failed", wrong);
    $("said").className = wrong ? "failed" : "";
    $("said").textContent = wrong ? `This pose cannot be; the nearest that can is red. ${nearest(k)}` : "";
    Frame.go(k + 0.5);
  }

  function element(kind, name, words, parent) {
    const made = document.createElement(kind);
    made.className = name;
    made.textContent = words;
    parent.append(made);
    return made;
  }

  data.sliders.forEach((slider, i) => {
    const label = element("label", "slider", "", $("sliders"));
    values.push(element("span", "value", "", label));
    element("span", "name", slider.name, label);
    element("div", "dim", slider.words, label);
    const input = element("input", "", "", label), ends = element("div", "ends dim", "", label);
    Object.assign(input, {type: "range", min: 0, max: slider.values.length - 1, step: 1});
    input.setAttribute("aria-label", slider.name);
    input.oninput = () => { places[i] = Number(input.value); show(); };
    inputs.push(input);
    for (const end of [slider.values[0], slider.values.at(-1)]) element("span", "", spelled(end, slider.unit), ends);
  });
  if (data.assemblies.length > 1) {
    const label = element("label", "slider", "", $("sliders"));
    element("span", "name", "configuration", label);
    const select = element("select", "", "", label);
    data.assemblies.forEach((name) => element("option", "", name, select));
    select.onchange = () => { assembly = select.selectedIndex; show(); };
  }
  $("start").onclick = () => { data.sliders.forEach((slider, i) => (places[i] = slider.start)); show(); };
  $("sliders").onsubmit = () => false;
  if (!Frame.open($("scene"), () => { Frame.alone(); show(); document.body.dataset.ready = "yes"; }, () => {}))
    Frame.say($("scene"), "This browser has no WebGL, so that the model cannot be drawn.");
  show();
})();
