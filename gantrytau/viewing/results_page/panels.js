// Panels of curves, one below the other, and bands of modes above them: one view of time, one cursor.
"use strict";
const Panels = (() => {
  const LEFT = 68, RIGHT = 14; // pixels beside the drawing, of panels and bands
  const LEAST = 150; // height of a panel, pixels
  const self = {panels: [], bands: [], view: null, past: [], active: null, a: null, b: null, onChange: () => {}, onTime: () => {}};
  let box, strip, hovered = null;

  self.span = () => {
    const runs = Data.runs.filter((run) => run.shown), all = runs.length ? runs : Data.runs;
    const low = Math.min(...all.map((run) => run.t[0])), high = Math.max(...all.map((run) => run.t[run.t.length - 1]));
    return high > low ? [low, high] : [low - 0.5, low + 0.5];
  };
  self.times = () => self.view || self.span();
  const curvesOf = (panel) => panel.curves.filter((curve) => Data.runs[curve.run].shown);

  async function curves(variable, against) {
    const found = [];
    for (let run = 0; run < Data.runs.length; run++) {
      const y = await Data.values(variable, run), x = against ? await Data.values(against, run) : Data.runs[run].t;
      if (y && x) found.push({variable, run, t: Data.runs[run].t, x, y, ordered: !against});
    }
    return found;
  }

  // colours by variable, or by run where there is one variable; dashes by run
  function colours(panel) {
    const several = panel.variables.length > 1;
    for (const curve of panel.curves) {
      curve.hue = several ? panel.hues.get(curve.variable.id) : curve.run;
      curve.dash = Curves.dash(curve.run);
    }
  }

  async function renew(panel) {
    panel.hues ??= new Map();
    for (const variable of panel.variables) {
      const taken = new Set(panel.hues.values());
      let hue = 0;
      while (taken.has(hue)) hue++;
      if (!panel.hues.has(variable.id)) panel.hues.set(variable.id, hue);
    }
    for (const id of panel.hues.keys()) if (!panel.variables.some((one) => one.id === id)) panel.hues.delete(id);
    panel.curves = (await Promise.all(panel.variables.map((one) => curves(one, panel.x)))).flat();
    colours(panel);
  }

  const unitOf = (panel) => panel.variables[0]?.unit;

  self.shown = (variable) =>
    self.bands.some((band) => band.variable === variable) || self.panels.some((panel) => panel.variables.includes(variable));

  self.toggle = async (variable, asCurve = false) => {
    if (self.shown(variable) && !asCurve) return self.remove(variable);
    if (variable.modes && !asCurve) {
      const band = {variable, curves: [], shade: !self.bands.some((one) => one.shade)};
      self.bands.push(band);
      band.curves = await curves(variable);
      return self.layout();
    }
    let panel = self.active;
    if (!panel || (panel.variables.length && unitOf(panel) !== variable.unit))
      panel = self.panels.find((one) => !one.x && (!one.variables.length || unitOf(one) === variable.unit)) || self.add();
    panel.variables.push(variable);
    self.active = panel;
    await renew(panel);
    self.layout();
  };

  self.remove = async (variable, from = null) => {
    self.bands = self.bands.filter((band) => band.variable !== variable || from);
    for (const panel of self.panels.filter((one) => (!from || one === from) && one.variables.includes(variable))) {
      panel.variables = panel.variables.filter((one) => one !== variable);
      await renew(panel);
    }
    self.panels = self.panels.filter((panel) => panel.variables.length || panel === self.active);
    if (self.panels.length > 1) self.panels = self.panels.filter((panel) => panel.variables.length);
    if (!self.panels.includes(self.active)) self.active = self.panels[0] || null;
    self.layout();
  };

  self.add = () => {
    const panel = {variables: [], curves: [], x: null, y: null, across: null};
    self.panels.push(panel);
    self.active = panel;
    return panel;
  };

  self.own = async (variable, from) => {
    await self.remove(variable, from);
    const panel = self.add();
    panel.variables.push(variable);
    await renew(panel);
    self.layout();
  };

  self.against = async (variable) => {
    const panel = self.active;
    if (!panel) return;
    panel.x = panel.x === variable ? null : variable;
    panel.y = panel.across = null;
    await renew(panel);
    self.layout();
  };

  self.clear = () => {
    Object.assign(self, {panels: [], bands: [], active: null, view: null, past: []});
    self.layout();
  };

  const state = () => ({view: self.view, panels: self.panels.map((panel) => [panel, panel.y, panel.across])});
  self.zoom = (view, panel = null, y = null) => {
    self.past.push(state());
    if (self.past.length > 50) self.past.shift();
    if (panel?.x) [panel.across, panel.y] = [view, y];
    else {
      self.view = view;
      if (panel && y) panel.y = y;
    }
    self.redraw();
  };
  self.back = () => {
    const old = self.past.pop();
    if (!old) return;
    self.view = old.view;
    for (const [panel, y, across] of old.panels) Object.assign(panel, {y, across});
    self.redraw();
  };
  self.fit = () => {
    self.past.push(state());
    self.view = null;
    for (const panel of self.panels) panel.y = panel.across = null;
    self.redraw();
  };

  self.limits = (panel) => {
    const shown = curvesOf(panel);
    const x = !panel.x ? self.times() : panel.across ||
      Curves.range(shown.map((curve) => ({...curve, y: curve.x})), -Infinity, Infinity);
    return [x, panel.y || Curves.range(shown, ...x)];
  };

  // --- drawing
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function paint(panel, u) {
    const {ctx} = u, {left, top, width, height} = u.bbox, [x] = panel.range;
    const X = (value) => u.valToPos(value, "x", true), Y = (value) => u.valToPos(value, "y", true);
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    for (const curve of curvesOf(panel)) {
      ctx.beginPath();
      Curves.trace(curve, x[0], x[1], X, Y, ctx);
      ctx.strokeStyle = ctx.fillStyle = Curves.colour(curve.hue);
      ctx.lineWidth = 1.6 * devicePixelRatio;
      ctx.lineJoin = "round";
      ctx.setLineDash(curve.dash.map((one) => one * devicePixelRatio));
      ctx.stroke();
      ctx.setLineDash([]);
      for (const [time, from, to] of Curves.jumps(curve, x[0], x[1])) {
        for (const [value, filled] of [[from, false], [to, true]]) {
          ctx.beginPath();
          ctx.arc(X(time), Y(value), 2.8 * devicePixelRatio, 0, 7);
          ctx.fillStyle = filled ? Curves.colour(curve.hue) : style("--back");
          ctx.fill();
          ctx.stroke();
        }
      }
      if (panel.x && self.a !== null) mark(panel, curve, ctx, X, Y);
    }
    ctx.restore();
  }

  function mark(panel, curve, ctx, X, Y) {
    const x = Data.at({...curve, y: curve.x}, self.a), y = Data.at(curve, self.a);
    if (!x || !y) return;
    ctx.beginPath();
    ctx.arc(X(x[1]), Y(y[1]), 5 * devicePixelRatio, 0, 7);
    ctx.fillStyle = Curves.colour(curve.hue);
    ctx.fill();
  }

  // the curve of the mode that shades a panel
  self.shading = (panel) =>
    panel.x ? null : self.bands.find((one) => one.shade)?.curves.find((one) => Data.runs[one.run].shown);

  function shade(panel, u) {
    const curve = self.shading(panel);
    if (!curve) return;
    const {ctx} = u, {left, top, width, height} = u.bbox, [low, high] = self.times();
    ctx.save();
    ctx.globalAlpha = 0.13;
    for (const [begin, end, value] of Curves.stretches(curve, low, high)) {
      if (value === 0) continue;
      const from = Math.max(u.valToPos(begin, "x", true), left), to = Math.min(u.valToPos(end, "x", true), left + width);
      ctx.fillStyle = Curves.band(value);
      ctx.fillRect(from, top, to - from, height);
    }
    ctx.restore();
  }

  function plot(panel, element) {
    const colour = style("--dim"), grid = {stroke: style("--grid"), width: 1};
    const axis = {stroke: colour, grid, ticks: grid, font: "12px system-ui, sans-serif"};
    const values = (_, splits) => splits.map((one) => (one === null ? "" : short(Math.abs(one) < 1e-12 * Math.abs(splits.at(-1) - splits[0]) ? 0 : one, [splits[0], splits.at(-1)])));
    const u = new uPlot({
      width: element.clientWidth, height: element.clientHeight || LEAST, padding: [8, RIGHT, 0, 0],
      scales: {x: {time: false, range: () => panel.range[0]}, y: {range: () => panel.range[1]}},
      axes: [{...axis, size: 30, values, space: (_, k, low, high) => Math.max(60, 16 + 7 * short(high, [low, high]).length)}, {...axis, size: LEFT, values}],
      series: [{}, {paths: () => null, points: {show: false}}],
      legend: {show: false},
      cursor: {points: {show: false}, y: Boolean(panel.x), drag: {x: true, y: true, uni: 25, setScale: false}, bind: {dblclick: () => null}},
      hooks: {
        drawAxes: [(u) => shade(panel, u), (u) => panel.x || Curves.limits(u, curvesOf(panel), self.times(), style("--wrong"))], draw: [(u) => paint(panel, u)],
        setSelect: [(u) => selected(panel, u)], setCursor: [(u) => moved(panel, u)],
      },
    }, [[0, 1], [null, null]], element);
    u.over.addEventListener("dblclick", self.fit);
    u.over.addEventListener("wheel", (event) => wheel(panel, u, event), {passive: false});
    fingers(panel, u);
    let pressed = null;
    u.over.addEventListener("mousedown", (event) => (pressed = [event.clientX, event.clientY]));
    u.over.addEventListener("click", (event) => {
      if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 3) return;
      if (!panel.x) self.pin(u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x"), event.shiftKey ? "b" : "a");
    });
    for (const name of ["a", "b", "h"]) {
      const pin = document.createElement("div");
      pin.className = `pin ${name}`;
      u.over.append(pin);
    }
    return u;
  }

  function selected(panel, u) {
    const {left, top, width, height} = u.select;
    if (width < 4 && height < 4) return;
    const whole = u.over.clientHeight, [x, y] = panel.range;
    const across = width >= u.over.clientWidth - 1 ? x : [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
    const along = height >= whole - 1 ? null : [u.posToVal(top + height, "y"), u.posToVal(top, "y")];
    u.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
    self.zoom(across, panel, along || (panel.x ? y : null));
  }

  let wheeling = 0;
  function wheel(panel, u, event) {
    event.preventDefault();
    const at = u.over.getBoundingClientRect();
    const about = (range, share, factor) => {
      const middle = range[0] + share * (range[1] - range[0]);
      return [middle + (range[0] - middle) * factor, middle + (range[1] - middle) * factor];
    };
    const factor = Math.exp(Math.sign(event.deltaY || event.deltaX) * 0.18), [x, y] = panel.range;
    const share = (event.clientX - at.left) / at.width, up = 1 - (event.clientY - at.top) / at.height;
    const fresh = performance.now() - wheeling > 700;
    wheeling = performance.now();
    const moved = 0.1 * (x[1] - x[0]) * Math.sign(event.deltaY || event.deltaX);
    const across = event.shiftKey ? x.map((one) => one + moved) : about(x, share, factor);
    self.zoom(across, panel, panel.x ? about(y, up, factor) : null);
    if (!fresh) self.past.pop();
  }

  function moved(panel, u) {
    if (panel.x) return;
    const time = u.cursor.left >= 0 ? u.posToVal(u.cursor.left, "x") : null;
    if (time === hovered) return;
    hovered = time;
    self.readings();
  }

  // one finger moves, two fingers zoom: what is under a finger stays under it
  function fingers(panel, u) {
    const at = new Map();
    const value = (px) => u.posToVal(px - u.over.getBoundingClientRect().left, "x");
    u.over.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "touch") return;
      if (!at.size) self.past.push(state());
      at.set(event.pointerId, event.clientX);
    });
    u.over.addEventListener("pointermove", (event) => {
      if (!at.has(event.pointerId)) return;
      const {left, width} = u.over.getBoundingClientRect(), held = [...at.values()].slice(0, 2).map(value);
      at.set(event.pointerId, event.clientX);
      const [p, q] = [...at.values()].slice(0, 2).map((px) => (px - left) / width), [x] = panel.range;
      const span = at.size > 1 && Math.abs(q - p) > 0.02 ? (held[1] - held[0]) / (q - p) : x[1] - x[0];
      if (!(span > 0)) return;
      self.zoom([held[0] - p * span, held[0] + (1 - p) * span], panel);
      self.past.pop();
    });
    for (const end of ["pointerup", "pointercancel", "pointerleave"])
      u.over.addEventListener(end, (event) => at.delete(event.pointerId));
  }

  self.pin = (time, which, quietly = false) => {
    if (time !== null) time = snapped(time);
    self[which] = time;
    self.readings();
    if (self.panels.some((panel) => panel.x)) self.redraw();
    if (which === "a" && !quietly) self.onTime(time);
  };

  // a jump that is less than four pixels away, else the time itself
  function snapped(time) {
    const [low, high] = self.times(), near = (4 * (high - low)) / Math.max(box.clientWidth - LEFT, 50);
    let best = time, distance = near;
    for (const panel of self.panels) for (const curve of curvesOf(panel))
      for (const [at] of Curves.jumps(curve, time - near, time + near))
        if (Math.abs(at - time) < distance) [best, distance] = [at, Math.abs(at - time)];
    return best;
  }

  // values at the pointer, or at the cursor, and differences from one cursor to the other
  self.readings = () => {
    const time = hovered ?? self.a;
    for (const panel of self.panels) {
      for (const [name, at] of [["a", self.a], ["b", self.b], ["h", hovered]]) {
        const pin = panel.u?.over.querySelector(`.pin.${name}`), px = at === null || panel.x ? -1 : panel.u?.valToPos(at, "x");
        if (pin) pin.style.transform = `translateX(${px >= 0 && px <= panel.u.over.clientWidth ? px : -10}px)`;
      }
      for (const curve of panel.curves) if (curve.reading) curve.reading.textContent = reading(curve, time, panel.range[1]);
    }
    for (const band of self.bands) for (const curve of band.curves)
      if (curve.reading) curve.reading.textContent = time === null ? "" : word(band, curve, time);
    self.onChange(time);
  };

  function word({variable}, curve, time) {
    const sides = (Data.at(curve, time) || []).map((one) => Curves.word(variable, one));
    return sides.length ? `= ${[...new Set(sides)].join(" → ")}` : "";
  }

  function reading(curve, time, range) {
    const now = time === null ? null : Data.at(curve, time);
    if (!now) return "";
    const text = [...new Set(now)].map((one) => short(one, range)).join(" → ");
    const [a, b] = [self.a, self.b].map((one) => (one === null ? null : Data.at(curve, one)));
    return a && b && hovered === null ? `${text} (Δ ${short(b[1] - a[1])})` : text;
  }

  self.redraw = () => {
    const long = self.panels.length === 0;
    box.classList.toggle("empty", long);
    for (const panel of self.panels) {
      panel.range = self.limits(panel);
      panel.u?.setData([panel.range[0], [null, null]]);
    }
    for (const band of self.bands) for (const curve of band.curves) Legend.paintBand(band, curve, self.times());
    self.readings();
  };

  self.layout = () => {
    for (const panel of self.panels) panel.u?.destroy();
    box.replaceChildren();
    strip.replaceChildren(...self.bands.flatMap((band) => Legend.band(band)));
    for (const panel of self.panels) {
      const {frame, room} = Legend.panel(panel);
      box.append(frame);
      panel.room = room;
    }
    sizes.disconnect();
    sizes.observe(strip);
    for (const panel of self.panels) {
      panel.range = self.limits(panel);
      panel.u = plot(panel, panel.room);
      sizes.observe(panel.room);
    }
    self.redraw();
    Tree.refresh();
  };

  const sizes = new ResizeObserver(() => requestAnimationFrame(() => {
    for (const panel of self.panels)
      if (panel.u && panel.room.clientWidth > 0 && (panel.u.width !== panel.room.clientWidth || panel.u.height !== panel.room.clientHeight))
        panel.u.setSize({width: panel.room.clientWidth, height: panel.room.clientHeight});
    for (const band of self.bands) for (const curve of band.curves) Legend.paintBand(band, curve, self.times());
    self.readings();
  }));

  self.start = (panels, bands) => {
    [box, strip] = [panels, bands];
    Curves.onTheme(self.layout);
  };
  self.curvesOf = curvesOf;
  self.LEFT = LEFT;
  self.RIGHT = RIGHT;
  return self;
})();
