// How a curve becomes a path: as many points as the screen can show, steps of what is held, gaps where a value is missing.
"use strict";
const Curves = (() => {
  const LIGHT = ["#1668a8", "#d1570a", "#23863e", "#c1272d", "#7a4fb0", "#7d4e42", "#b81d7f", "#596573", "#8a7d00", "#00808f"];
  const DARK = ["#63b3f0", "#ffa14f", "#67cf7f", "#ff7b7b", "#bb9af0", "#cf9f90", "#f58bd0", "#b4c0cc", "#d9cb4a", "#4fd3e0"];
  const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];
  const MARKED = 60; // jumps in view that are still marked by points at both ends
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const self = {isDark: () => dark.matches, onTheme: (call) => dark.addEventListener("change", call)};

  self.colour = (k, light = !dark.matches) => (light ? LIGHT : DARK)[k % LIGHT.length];
  // of a mode by its number, each another one
  self.band = (value, light = !dark.matches) =>
    `hsl(${((207 + 137.508 * (value < 0 ? 0.5 - value : value)) % 360).toFixed(1)}, 60%, ${light ? 42 : 68}%)`;
  self.dash = (k) => DASHES[k % DASHES.length];

  const steps = (curve) => curve.variable.held || curve.variable.modes;

  // range of what is seen of curves between two abscissae
  self.range = (curves, low, high) => {
    let least = Infinity, most = -Infinity;
    for (const curve of curves) {
      const {x, y, ordered} = curve, first = ordered ? Data.before(x, low) : 0;
      for (let n = first; n < y.length; n++) {
        if (ordered && x[n] > high && n > first + 1) break;
        if (y[n] < least) least = y[n];
        if (y[n] > most) most = y[n];
      }
    }
    return self.padded(least, most);
  };

  self.padded = (least, most) => {
    if (!(least <= most)) return [0, 1];
    const size = Math.max(Math.abs(least), Math.abs(most));
    const pad = most - least > 1e-12 * size ? 0.05 * (most - least) : 0.1 * (size || 1);
    return [least - pad, most + pad];
  };

  // x over (low, high) goes to pixels X(x), y to Y(y); sink: moveTo and lineTo
  self.trace = (curve, low, high, X, Y, sink) => {
    const {t, x, y, ordered} = curve, held = ordered && steps(curve);
    const first = ordered ? Data.before(x, low) : 0;
    const last = ordered ? Math.min(Data.before(x, high) + 1, x.length - 1) : x.length - 1;
    const dense = ordered && last - first > 4 * Math.abs(X(high) - X(low));
    let down = false, column = NaN, least, most, end, before = 0;
    const flush = () => {
      if (Number.isNaN(column)) return;
      sink.lineTo(column, least);
      sink.lineTo(column, most);
      sink.lineTo(column, end);
      column = NaN;
    };
    for (let n = first; n <= last; n++) {
      if (!Number.isFinite(y[n]) || !Number.isFinite(x[n])) {
        flush();
        down = false;
        continue;
      }
      const px = X(x[n]), py = Y(y[n]);
      const apart = !ordered && n > first && t[n] === t[n - 1]; // nothing lies between both sides of a jump
      if (!down || apart) sink.moveTo(px, py);
      else if (!dense) {
        if (held) sink.lineTo(px, before);
        sink.lineTo(px, py);
      } else if (Math.round(px) === column) {
        least = Math.min(least, py);
        most = Math.max(most, py);
        end = py;
      } else {
        flush();
        if (held) sink.lineTo(Math.round(px), before);
        column = Math.round(px);
        least = most = end = py;
        sink.lineTo(column, py);
      }
      down = true;
      before = py;
    }
    flush();
  };

  // where a curve jumps between two times: [time, left, right]; none where there are too many
  self.jumps = (curve, low, high) => {
    const {x, y, ordered} = curve, found = [];
    if (!ordered) return found;
    for (let n = Math.max(Data.before(x, low), 1); n < x.length && x[n] <= high; n++) {
      if (x[n] !== x[n - 1] || y[n] === y[n - 1] || x[n] < low) continue;
      found.push([x[n], y[n - 1], y[n]]);
      if (found.length > MARKED) return [];
    }
    return found;
  };

  // stretches of equal values between two times: [begin, end, value]
  self.stretches = (curve, low, high) => {
    const {t, y} = curve, found = [];
    let n = Data.before(t, low);
    while (n < t.length && t[n] <= high) {
      let end = n + 1;
      while (end < t.length && (y[end] === y[n] || t[end] === t[n])) {
        if (y[end] !== y[n] && t[end] === t[n]) n = end; // the right side of a jump
        end++;
      }
      found.push([t[n], end < t.length ? t[end] : t[t.length - 1], y[n]]);
      n = end;
    }
    return found.filter(([begin, end]) => end > low && end > begin);
  };

  // where a curve is beyond its limits between two times: [begin, end]
  self.beyond = ({t, y, variable, ordered}, low, high) => {
    const [least, most] = variable.limits || [null, null], found = [];
    if (!ordered || !variable.beyond) return found;
    const out = (value) => (least !== null && value < least) || (most !== null && value > most);
    for (let n = Data.before(t, low); n < t.length && t[n] <= high; n++) {
      if (!out(y[n])) continue;
      const begin = n;
      while (n + 1 < t.length && out(y[n + 1])) n++;
      found.push([t[begin], t[n]]);
    }
    return found;
  };

  // the limits of curves as lines, and shades where these are beyond; u: the plot
  self.limits = (u, curves, [low, high], colour) => {
    const {ctx} = u, {left, top, width, height} = u.bbox;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    ctx.strokeStyle = ctx.fillStyle = colour;
    ctx.setLineDash([2, 4].map((one) => one * devicePixelRatio));
    for (const curve of curves) {
      ctx.globalAlpha = 0.13;
      for (const [begin, end] of self.beyond(curve, low, high)) {
        const from = u.valToPos(begin, "x", true);
        ctx.fillRect(from, top, Math.max(u.valToPos(end, "x", true) - from, 1), height);
      }
      ctx.globalAlpha = 0.8;
      for (const limit of (curve.variable.limits || []).filter((one) => one !== null)) {
        const y = u.valToPos(limit, "y", true);
        ctx.beginPath();
        ctx.moveTo(left, y);
        ctx.lineTo(left + width, y);
        ctx.stroke();
      }
    }
    ctx.restore();
  };

  self.word = (variable, value) => variable.modes?.[value] ?? String(value);

  // round numbers between two limits, about so many
  self.ticks = (low, high, count) => {
    const rough = (high - low) / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step && found.length < 50; k++) found.push(k * step);
    return found;
  };
  return self;
})();
