"use strict";
/* Figures: what a mark stands for is told where the pointer or the arrow keys are, and a figure opens
   large, to be zoomed and moved. Without this script the marks' own titles tell it. */

(() => {
  const MOST = 40; // times larger at most
  const NS = "http://www.w3.org/2000/svg";
  const words = new WeakMap(); // of each mark
  const marked = new WeakMap(); // the mark behind what widens its reach
  const tip = element("div", "tip", { role: "status" });
  let told = null;

  function element(name, className, attributes = {}) {
    const made = document.createElement(name);
    made.className = className;
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  }

  function button(text, act, label) {
    const made = element("button", "", { type: "button", ...(label && { "aria-label": label }) });
    made.textContent = text;
    made.addEventListener("click", act);
    return made;
  }

  /* What a mark says, and the figures at the place of it that is nearest. */

  function nearest(mark, x, y) {
    let best = null, least = Infinity;
    const offer = (px, py) => {
      const far = (px - x) ** 2 + (py - y) ** 2;
      if (far < least) [best, least] = [[px, py], far];
    };
    for (const dot of mark.querySelectorAll("circle")) offer(dot.cx.baseVal.value, dot.cy.baseVal.value);
    for (const path of mark.querySelectorAll("path")) {
      const points = path.getAttribute("d").slice(1).split("L").map((pair) => pair.split(",").map(Number));
      points.forEach(([bx, by], i) => {
        const [ax, ay] = points[Math.max(0, i - 1)], dx = bx - ax, dy = by - ay;
        const along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1);
        const t = Math.min(1, Math.max(0, along));
        offer(ax + t * dx, ay + t * dy);
      });
    }
    return best;
  }

  function read(mark, x, y) {
    const axes = mark.dataset.axes, place = axes && nearest(mark, x, y);
    if (!place) return words.get(mark);
    const [left, top, width, height, x0, x1, y0, y1, log] = axes.split(" ").map(Number);
    const along = x0 + ((place[0] - left) / width) * (x1 - x0);
    const up = y1 - ((place[1] - top) / height) * (y1 - y0);
    const named = (label, value) => {
      const cut = label.lastIndexOf(", "), shown = Number(value.toPrecision(3));
      return cut < 0 ? `${label} ${shown}` : `${label.slice(0, cut)} ${shown} ${label.slice(cut + 2)}`;
    };
    return `${words.get(mark)}\n${named(mark.dataset.x, log ? 10 ** along : along)}, ${named(mark.dataset.y, up)}`;
  }

  function tell(mark, clientX, clientY) {
    told?.classList.remove("told");
    told = mark;
    tip.hidden = !mark;
    if (!mark) return;
    mark.classList.add("told");
    const at = new DOMPoint(clientX, clientY).matrixTransform(mark.ownerSVGElement.getScreenCTM().inverse());
    const text = read(mark, at.x, at.y);
    if (tip.textContent !== text) tip.textContent = text;
    const { width, height } = tip.getBoundingClientRect();
    const below = clientY + 14 + height < innerHeight;
    tip.style.left = `${Math.max(4, Math.min(clientX + 12, innerWidth - width - 6))}px`;
    tip.style.top = `${Math.max(4, below ? clientY + 14 : clientY - height - 10)}px`;
  }

  function step(svg, by) {
    const marks = [...svg.querySelectorAll("g")].filter((g) => words.has(g));
    if (!marks.length) return;
    const now = marks.indexOf(told);
    const mark = marks[now < 0 ? (by > 0 ? 0 : marks.length - 1) : (now + by + marks.length) % marks.length];
    mark.scrollIntoView({ block: "nearest", inline: "nearest" });
    const box = mark.getBoundingClientRect();
    tell(mark, box.right, box.top); // the end of a curve
  }

  const markAt = (target) => marked.get(target) ?? target?.closest("g[data-told]");
  const touch = ({ clientX, clientY }) => tell(markAt(document.elementFromPoint(clientX, clientY)), clientX, clientY);

  /* The large view: a dialog that borrows the figure. */

  const dialog = element("dialog", "large");
  const sheet = element("div", "sheet", { tabindex: "0", role: "group" });
  const bar = element("div", "bar");
  dialog.append(bar, sheet);
  let open = null; // {svg, home, own: its view box, whole: that in the shape of the sheet}

  function setBox(x, y, width) {
    const { svg, whole } = open;
    const w = Math.min(whole[2], Math.max(whole[2] / MOST, width)), h = (w * whole[3]) / whole[2];
    const inside = (value, low, room) => Math.min(low + Math.max(0, room), Math.max(low, value));
    const left = inside(x, whole[0], whole[2] - w), top = inside(y, whole[1], whole[3] - h);
    svg.setAttribute("viewBox", [left, top, w, h].map((v) => Number(v.toFixed(3))).join(" "));
  }

  function zoom(factor, clientX, clientY) {
    const { x, y, width, height } = open.svg.viewBox.baseVal;
    const at =
      clientX === undefined
        ? { x: x + width / 2, y: y + height / 2 }
        : new DOMPoint(clientX, clientY).matrixTransform(open.svg.getScreenCTM().inverse());
    const scale = Math.min(1 / factor, open.whole[2] / width);
    setBox(at.x - (at.x - x) * scale, at.y - (at.y - y) * scale, width * scale);
    tell(null);
  }

  function move(right, down) {
    const { x, y, width } = open.svg.viewBox.baseVal;
    setBox(x + right, y + down, width);
  }

  const whole = () => setBox(...open.whole);
  bar.append(
    button("+", () => zoom(1.4), "Zoom in"), button("−", () => zoom(1 / 1.4), "Zoom out"),
    button("Whole", whole), button("Close", () => dialog.close()),
  );

  function enlarge(svg, home) {
    const own = svg.getAttribute("viewBox");
    tell(null);
    home.style.minHeight = `${home.clientHeight}px`;
    dialog.setAttribute("aria-label", svg.getAttribute("aria-label") ?? home.getAttribute("aria-label") ?? "Figure");
    sheet.setAttribute("aria-label", "Figure: arrows tell its marks, Shift with arrows moves it, + and - zoom");
    sheet.append(svg);
    dialog.append(tip);
    dialog.showModal();
    const [x, y, width, height] = own.split(" ").map(Number);
    const shape = sheet.clientHeight / sheet.clientWidth || height / width;
    const w = Math.max(width, height / shape), h = Math.max(height, width * shape);
    open = { svg, home, own, whole: [x - (w - width) / 2, y - (h - height) / 2, w, h] };
    whole();
    sheet.focus();
  }

  dialog.addEventListener("close", () => {
    tell(null);
    open.svg.setAttribute("viewBox", open.own);
    open.home.append(open.svg);
    open.home.style.minHeight = "";
    open = null;
    document.body.append(tip);
  });
  sheet.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(2 ** (-event.deltaY / 300), event.clientX, event.clientY);
  }, { passive: false });
  const fingers = new Map(); // or the mouse: where each one is
  sheet.addEventListener("pointerdown", (event) => {
    sheet.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  sheet.addEventListener("pointermove", ({ pointerId, clientX: x, clientY: y }) => {
    const was = fingers.get(pointerId);
    if (!was || !open) return;
    const other = [...fingers].find(([id]) => id !== pointerId)?.[1];
    if (other) {
      const far = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]) || 1;
      zoom(far([x, y]) / far(was), (x + other[0]) / 2, (y + other[1]) / 2);
    } else {
      const scale = open.svg.getScreenCTM().a;
      move((was[0] - x) / scale, (was[1] - y) / scale);
    }
    fingers.set(pointerId, [x, y]);
  });
  for (const name of ["pointerup", "pointercancel"]) sheet.addEventListener(name, (event) => fingers.delete(event.pointerId));

  /* Every figure of the page. */

  const STEPS = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };
  function keys(event, svg) {
    if (!svg || event.ctrlKey || event.metaKey || event.altKey) return;
    const { key } = event, by = STEPS[key];
    const pace = open && 0.1 * svg.viewBox.baseVal.width;
    if (by && open && event.shiftKey) move(...(/t$/.test(key) ? [by * pace, 0] : [0, by * pace]));
    else if (by) step(svg, by);
    else if (open && "+=".includes(key)) zoom(1.4);
    else if (open && "-_".includes(key)) zoom(1 / 1.4);
    else if (open && (key === "0" || key === "Home")) whole();
    else if (!open && key === "Enter") enlarge(svg, svg.parentElement);
    else if (!open && key === "Escape") tell(null);
    else return;
    event.preventDefault();
  }
  sheet.addEventListener("click", touch);
  sheet.addEventListener("keydown", (event) => keys(event, open?.svg));

  for (const home of document.querySelectorAll("figure .wide")) {
    const svg = home.querySelector("svg");
    const title = svg.querySelector(":scope > title");
    if (title) {
      svg.setAttribute("role", "img");
      svg.setAttribute("aria-label", title.textContent);
      title.remove();
    }
    const titles = [...svg.querySelectorAll("g > title")];
    const reach = document.createElementNS(NS, "g");
    titles[0]?.parentElement.before(reach); // under the marks, over grid and frame
    for (const each of titles) {
      const mark = each.parentElement;
      words.set(mark, each.textContent);
      mark.dataset.told = "";
      each.remove();
      for (const shape of mark.querySelectorAll("path, circle")) {
        const wide = shape.cloneNode();
        wide.setAttribute("class", "reach");
        marked.set(wide, mark);
        reach.append(wide);
      }
    }
    svg.addEventListener("pointermove", (event) => {
      const mark = event.buttons ? null : markAt(event.target);
      if (mark || told) tell(mark, event.clientX, event.clientY);
    });
    svg.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && tell(null));
    svg.addEventListener("click", touch);
    home.addEventListener("keydown", (event) => keys(event, svg));
    home.addEventListener("blur", () => tell(null));
    const grow = button("Enlarge", () => enlarge(svg, home));
    grow.className = "enlarge";
    home.before(grow);
  }
  tip.hidden = true;
  document.body.append(dialog, tip);
})();
