// The numbers of the page: blocks are inflated when a signal of them is first asked for, see packed_runs.py.
"use strict";
const Data = (() => {
  const blocks = document.getElementById("data").textContent.trim().split("\n");
  const inflated = new Map();

  async function inflate(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  function block(k) {
    if (!inflated.has(k)) inflated.set(k, inflate(blocks[k + 1]));
    return inflated.get(k);
  }

  // integers of a row are sums of differences of an order, the lowest bit of which is the sign
  function integers(buffer, row, rows, order, size) {
    const planes = new Uint8Array(buffer), plane = rows * size, found = new Int32Array(size);
    for (let from = row * size, shift = 0; from < planes.length; from += plane, shift += 8)
      for (let n = 0; n < size; n++) found[n] |= planes[from + n] << shift;
    for (let n = 0; n < size; n++) found[n] = (found[n] >>> 1) ^ -(found[n] & 1);
    for (; order > 0; order--) for (let n = 1; n < size; n++) found[n] = (found[n] + found[n - 1]) | 0;
    return found;
  }

  const self = {runs: [], variables: [], bits: 0};

  self.ready = (async () => {
    const told = JSON.parse(await new Response(await inflate(blocks[0])).text());
    Object.assign(self, told);
    for (const run of self.runs) {
      run.t = new Float64Array(await block(run.time));
      run.signals = new Map();
      run.shown = true;
    }
    self.variables.forEach((variable, k) => (variable.id = k));
  })();

  // the shortest decimal number that is nearer to a value than the page knows it
  self.rounded = (value, variable, k) => {
    const held = variable.runs[k];
    if (!Number.isFinite(value)) return "nan";
    if (!Array.isArray(held)) return value;
    const near = Math.abs((variable.scale || [1])[0]) * 0.51 * self.runs[k].columns[held[0]][5];
    for (let digits = 1; digits < 17; digits++) {
      const found = Number(value.toPrecision(digits));
      if (Math.abs(found - value) <= near) return found;
    }
    return value;
  };

  self.isConstant = (variable) => variable.runs.every((held) => !Array.isArray(held));

  // the values of a variable in a run as they are shown, (times,); null where the run does not have it
  self.values = async (variable, k) => {
    const run = self.runs[k], held = variable.runs[k], [a, b] = variable.scale || [1, 0];
    if (held === null) return null;
    if (run.signals.has(variable.id)) return run.signals.get(variable.id);
    const values = new Float64Array(run.size);
    if (!Array.isArray(held)) values.fill(a * held + b);
    else {
      const [at, row, rows, order, least, step] = run.columns[held[0]];
      const found = integers(await block(at), row, rows, order, run.size);
      const factor = a * held[1] * step;
      for (let n = 0; n < run.size; n++) values[n] = found[n] === -1 ? NaN : factor * (found[n] + least) + b;
    }
    run.signals.set(variable.id, values);
    return values;
  };

  // last index with t[index] <= time, at least 0
  self.before = (t, time) => {
    let low = 0, high = t.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (t[middle] <= time) low = middle + 1;
      else high = middle;
    }
    return Math.max(low - 1, 0);
  };

  // values on both sides of a time, [left, right]: equal but at a jump
  self.at = (curve, time) => {
    const {t, y} = curve;
    if (!(time >= t[0] && time <= t[t.length - 1])) return null;
    const last = self.before(t, time);
    if (t[last] === time) {
      let first = last;
      while (first > 0 && t[first - 1] === time) first--;
      return [y[first], y[last]];
    }
    const share = curve.variable.held || curve.variable.modes ? 0 : (time - t[last]) / (t[last + 1] - t[last]);
    const value = y[last] + (share && share * (y[last + 1] - y[last]));
    return [value, value];
  };
  return self;
})();
