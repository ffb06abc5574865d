// What is shown, as CSV, SVG or PNG.
"use strict";
const Export = (() => {
  const self = {}, BAND = 24, ROW = 18, AXIS = 40, LEFT = 72;

  function save(blob, suffix) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `${document.title.replace(/[^\w.-]+/g, "_") || "result"}.${suffix}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
  }

  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const heading = (name, unit, run) =>
    quoted(name + (unit && unit !== "1" ? ` [${unit}]` : "") + (Data.runs.length > 1 ? ` (${run.title})` : ""));

  // one column of time for each run, then what is drawn of it, within what is seen
  self.table = () => {
    const [low, high] = Panels.times(), columns = [];
    Data.runs.forEach((run, k) => {
      if (!run.shown) return;
      const chosen = new Map();
      for (const {curves} of [...Panels.bands, ...Panels.panels])
        for (const curve of curves.filter((one) => one.run === k)) chosen.set(curve.variable.id, curve);
      for (const {x, curves} of Panels.panels)
        if (x) for (const curve of curves.filter((one) => one.run === k)) chosen.set(x.id, {...curve, variable: x, y: curve.x});
      if (!chosen.size) return;
      const rows = [...run.t.keys()].filter((n) => run.t[n] >= low && run.t[n] <= high);
      columns.push([heading("time", "s", run), rows.map((n) => run.t[n])]);
      for (const {variable, y} of chosen.values())
        columns.push([heading(variable.name, variable.unit, run), rows.map((n) => Data.rounded(y[n], variable, k))]);
    });
    const longest = Math.max(0, ...columns.map(([, values]) => values.length));
    const lines = [columns.map(([name]) => name).join(",")];
    for (let n = 0; n < longest; n++) lines.push(columns.map(([, values]) => values[n] ?? "").join(","));
    return lines.join("\n") + "\n";
  };
  self.csv = () => save(new Blob([self.table()], {type: "text/csv"}), "csv");

  const escaped = (text) => String(text).replace(/[&<>"]/g, (letter) => `&#${letter.charCodeAt(0)};`);
  const text = (x, y, words, more = "") => `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" ${more}>${escaped(words)}</text>`;
  const line = (x1, y1, x2, y2, more) => `<line x1="${x1.toFixed(1)}" y1="${y1.toFixed(1)}" x2="${x2.toFixed(1)}" y2="${y2.toFixed(1)}" ${more}/>`;
  const unitOf = (variable) => (variable?.unit && variable.unit !== "1" ? ` [${variable.unit}]` : "");

  function path(curve, x, X, Y) {
    const parts = [], at = (px, py) => `${px.toFixed(1)} ${py.toFixed(1)}`;
    Curves.trace(curve, x[0], x[1], X, Y, {moveTo: (px, py) => parts.push(`M${at(px, py)}`), lineTo: (px, py) => parts.push(`L${at(px, py)}`)});
    return `<path d="${parts.join("")}" fill="none" stroke="${Curves.colour(curve.hue, true)}" stroke-width="1.6" stroke-dasharray="${curve.dash.join(" ")}"/>`;
  }

  function panel(one, top, width, parts) {
    const shown = Panels.curvesOf(one), [x, y] = Panels.limits(one), height = Math.max(one.room.clientHeight - 40, 120);
    shown.forEach((curve, k) => {
      const run = Data.runs.length > 1 ? ` (${Data.runs[curve.run].title})` : "", at = top + ROW * k + 12;
      parts.push(line(LEFT, at - 4, LEFT + 26, at - 4, `stroke="${Curves.colour(curve.hue, true)}" stroke-width="2.5" stroke-dasharray="${curve.dash.join(" ")}"`));
      parts.push(text(LEFT + 32, at, curve.variable.name + unitOf(curve.variable) + run));
    });
    top += ROW * shown.length + 4;
    const X = (v) => LEFT + ((v - x[0]) / (x[1] - x[0])) * width, Y = (v) => top + height - ((v - y[0]) / (y[1] - y[0])) * height;
    for (const v of Curves.ticks(...x, width / 90)) parts.push(line(X(v), top, X(v), top + height, 'stroke="#ddd"'), text(X(v), top + height + 15, short(v, x), 'text-anchor="middle"'));
    for (const v of Curves.ticks(...y, height / 35)) parts.push(line(LEFT, Y(v), LEFT + width, Y(v), 'stroke="#ddd"'), text(LEFT - 6, Y(v) + 4, short(v, y), 'text-anchor="end"'));
    const id = `clip${parts.length}`, shade = Panels.shading(one);
    for (const [begin, end, value] of shade ? Curves.stretches(shade, ...x) : [])
      if (value) parts.push(`<rect x="${X(Math.max(begin, x[0]))}" y="${top}" width="${X(Math.min(end, x[1])) - X(Math.max(begin, x[0]))}" height="${height}" fill="${Curves.band(value, true)}" fill-opacity="0.13"/>`);
    parts.push(`<clipPath id="${id}"><rect x="${LEFT}" y="${top}" width="${width}" height="${height}"/></clipPath><g clip-path="url(#${id})">`);
    for (const curve of shown) parts.push(path(curve, x, X, Y));
    parts.push(`</g><rect x="${LEFT}" y="${top}" width="${width}" height="${height}" fill="none" stroke="#888"/>`);
    parts.push(text(LEFT + width / 2, top + height + 32, one.x ? one.x.name + unitOf(one.x) : "time [s]", 'text-anchor="middle"'));
    return top + height + AXIS;
  }

  function band(curve, top, width, parts) {
    const [low, high] = Panels.times(), X = (v) => LEFT + ((Math.min(Math.max(v, low), high) - low) / (high - low)) * width;
    const run = Data.runs.length > 1 ? ` (${Data.runs[curve.run].title})` : "";
    parts.push(text(LEFT, top + 12, curve.variable.name + run));
    for (const [begin, end, value] of Curves.stretches(curve, low, high)) {
      const word = Curves.word(curve.variable, value), size = X(end) - X(begin);
      parts.push(`<rect x="${X(begin)}" y="${top + 16}" width="${size}" height="16" fill="${Curves.band(value, true)}" fill-opacity="${value === 0 ? 0.12 : 0.45}"/>`);
      if (size > 7 * word.length + 6) parts.push(text(X(begin) + 4, top + 28, word));
    }
    return top + 16 + BAND;
  }

  self.drawing = () => {
    const width = Math.max(document.getElementById("panels").clientWidth - LEFT - 20, 300), parts = [];
    let top = 8;
    for (const one of Panels.bands) for (const curve of one.curves.filter((c) => Data.runs[c.run].shown)) top = band(curve, top, width, parts);
    for (const one of Panels.panels) top = panel(one, top, width, parts);
    const size = [width + LEFT + 20, top + 8];
    return {size, text: `<svg xmlns="http://www.w3.org/2000/svg" width="${size[0]}" height="${size[1]}" viewBox="0 0 ${size.join(" ")}" ` +
      `font-family="system-ui, sans-serif" font-size="12" fill="#222"><rect width="100%" height="100%" fill="#fff"/>${parts.join("\n")}</svg>`};
  };
  self.svg = () => save(new Blob([self.drawing().text], {type: "image/svg+xml"}), "svg");

  self.picture = async () => {
    const {size, text: drawn} = self.drawing(), image = new Image(), canvas = document.createElement("canvas");
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(drawn)}`;
    await image.decode();
    [canvas.width, canvas.height] = size.map((one) => 2 * one);
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    return new Promise((done) => canvas.toBlob(done, "image/png"));
  };
  self.png = async () => save(await self.picture(), "png");
  return self;
})();
