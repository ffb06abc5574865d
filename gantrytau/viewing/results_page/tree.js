// The tree of variables by component, and the search in it.
"use strict";
const Tree = (() => {
  const MOST = 300; // rows of a search
  const FEW = 9; // elements of a vector that is ticked whole
  const self = {ticked: () => false, onTick: () => {}, onX: () => {}};
  let root, box, wanted = "";

  // der(a.b) stands beside a.b; elements stand in their vector
  function path(name) {
    const match = /^((?:der\()*)(.*?)(\)*)$/.exec(name);
    const [, before, inner, behind] = match[1] ? match : [, "", name, ""];
    const parts = inner.split(/\.(?![^[]*\])/);
    const leaf = before + parts.pop() + behind;
    const element = /^(.*[^[])\[\d+(, ?\d+)*\](\)*)$/.exec(leaf);
    return element ? [...parts, element[1] + element[3], leaf] : [...parts, leaf];
  }

  function build(variables) {
    root = {name: "", children: new Map(), open: true};
    for (const variable of variables) {
      let node = root;
      for (const part of path(variable.name)) {
        if (!node.children.has(part)) node.children.set(part, {name: part, children: new Map(), open: false});
        node = node.children.get(part);
      }
      node.variable = variable;
    }
    for (const node of root.children.values()) node.open = root.children.size === 1;
  }

  function row(node, depth, name) {
    const line = document.createElement("div"), variable = node.variable;
    line.className = "row" + (variable ? "" : " component");
    line.style.paddingLeft = `${0.4 + 0.9 * depth}rem`;
    line.tabIndex = 0;
    line.setAttribute("role", "treeitem");
    const label = document.createElement("span");
    label.className = "name";
    label.textContent = name;
    if (!variable) {
      line.setAttribute("aria-expanded", node.open);
      const arrow = document.createElement("span");
      arrow.className = "arrow";
      arrow.textContent = node.open ? "▾" : "▸";
      const count = document.createElement("span");
      count.className = "dim";
      count.textContent = leaves(node);
      line.append(arrow, label, count);
      line.onclick = () => { node.open = !node.open; draw(); };
      const elements = [...node.children.values()].map((child) => child.variable);
      if (elements.every((one) => one?.name.includes("[")) && elements.length <= FEW) arrow.after(all(elements, name));
    } else {
      line.dataset.name = variable.name;
      const tick = document.createElement("input");
      tick.type = "checkbox";
      tick.tabIndex = -1;
      tick.checked = self.ticked(variable);
      tick.setAttribute("aria-label", variable.name);
      const unit = document.createElement("span");
      unit.className = "unit";
      const constant = variable.runs.find((held) => held !== null);
      const [a, b] = variable.scale || [1, 0];
      const value = Data.isConstant(variable) && constant !== undefined ? `= ${short(a * constant + b)} ` : "";
      unit.textContent = value + (variable.unit === "1" ? "" : variable.unit);
      const words = document.createElement("span");
      words.className = "dim words";
      words.textContent = variable.words || "";
      if (variable.beyond) {
        unit.textContent = "⚠ " + unit.textContent;
        unit.classList.add("beyond");
      }
      const x = document.createElement("button");
      x.className = "as-x";
      x.textContent = "x";
      x.title = "draw the panel against this variable";
      x.onclick = (event) => { event.stopPropagation(); self.onX(variable); };
      line.append(tick, label, unit, words, x);
      line.title = `${variable.name}${variable.unit && variable.unit !== "1" ? ` [${variable.unit}]` : ""}` +
        (variable.words ? `: ${variable.words}` : "") + (variable.beyond || []).map((one) => `\n⚠ ${one}`).join("");
      line.onclick = () => self.onTick(variable);
    }
    line.onkeydown = (event) => keys(event, line);
    return line;
  }

  // the tick of a whole vector
  function all(elements, name) {
    const tick = document.createElement("input");
    tick.type = "checkbox";
    tick.title = `all of ${name}`;
    tick.checked = elements.every(self.ticked);
    tick.onclick = async (event) => {
      event.stopPropagation();
      const wanted = tick.checked;
      for (const one of elements) if (self.ticked(one) !== wanted) await self.onTick(one);
    };
    return tick;
  }

  function keys(event, line) {
    const step = {ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling"}[event.key];
    if (step) line[step]?.focus();
    else if (event.key === "Enter" || event.key === " ") line.click();
    else return;
    event.preventDefault();
  }

  function leaves(node) {
    node.count ??= [...node.children.values()].reduce((sum, child) => sum + leaves(child), node.variable ? 1 : 0);
    return node.count;
  }

  function* rows(node, depth) {
    for (const child of node.children.values()) {
      if (child.variable) yield row(child, depth, child.name);
      if (!child.children.size) continue;
      yield row({...child, variable: undefined, get open() { return child.open; }, set open(to) { child.open = to; }},
        depth, child.name);
      if (child.open) yield* rows(child, depth + 1);
    }
  }

  // every word of the search stands in the name, the unit or the description; * stands for anything
  function found() {
    const words = wanted.toLowerCase().split(/\s+/).filter(Boolean).map((word) =>
      new RegExp(word.split("*").map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&")).join(".*")));
    return Data.variables.filter((variable) => {
      const text = `${variable.name} ${variable.unit} ${variable.words || ""} ${(variable.beyond || []).join(" ")}`.toLowerCase();
      return words.every((word) => word.test(text));
    });
  }

  function draw() {
    const place = box.scrollTop, kept = document.activeElement?.dataset?.name;
    if (wanted.trim()) {
      const all = found();
      box.replaceChildren(...all.slice(0, MOST).map((variable) => row({variable}, 0, variable.name)));
      const said = document.createElement("div");
      said.className = "dim said";
      said.textContent = all.length > MOST ? `${MOST} of ${all.length} shown; search for more letters` : `${all.length} found`;
      box.append(said);
    } else box.replaceChildren(...rows(root, 0));
    box.scrollTop = place;
    if (kept) box.querySelector(`[data-name="${CSS.escape(kept)}"]`)?.focus({preventScroll: true});
  }

  self.start = (element, search) => {
    box = element;
    build(Data.variables);
    search.placeholder = `search ${Data.variables.length} variables`;
    search.oninput = () => { wanted = search.value; box.scrollTop = 0; draw(); };
    draw();
  };
  self.refresh = () => draw();
  return self;
})();

// a number in six digits, or as many as tell it from others of a range
function short(value, range = [0, 0]) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const more = Math.ceil(Math.log10(Math.abs(value) / (range[1] - range[0]))) + 4;
  return String(Number(value.toPrecision(Math.min(Math.max(6, Number.isFinite(more) ? more : 0), 15)))).replace("e+", "e");
}
