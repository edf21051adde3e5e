"use strict";
/* The controls of a plan's page around the viewer. The page stands without them: tables, figure and
   how-to are plain HTML. */

(() => {
  const $ = (selector) => document.querySelector(selector);
  const $$ = (selector) => [...document.querySelectorAll(selector)];
  const canvas = $("#view");
  const stage = canvas.parentElement;
  const data = JSON.parse($("#data").textContent);
  let viewer;
  try {
    const shells = decodeShells($("#geometry").textContent, data.shells);
    viewer = createViewer(canvas, { ...data, shells });
  } catch (error) {
    console.error(error);
    $("#no-view").hidden = false;
    document.body.classList.add("flat");
    document.documentElement.dataset.ready = "without-view";
    return;
  }
  window.planView = viewer;
  for (const item of $$("[data-needs-view]")) item.hidden = false;

  /* Light or dark: what is drawn in the page's ink follows it. */

  followTheme(viewer);

  /* Materials: on and off, and pointed out from wherever they are named. */

  const boxes = $$("#materials li input");
  boxes.forEach((box, number) => box.addEventListener("change", () => viewer.setShown(number, box.checked)));
  const all = (value) => {
    boxes.forEach((box, number) => {
      box.checked = value;
      viewer.setShown(number, value);
    });
  };
  $("#show-all")?.addEventListener("click", () => all(true));
  $("#hide-all")?.addEventListener("click", () => all(false));

  let lit = null;
  const light = (number) => {
    if (number === lit) return;
    lit = number;
    // Out of sight a frame is only lost time: without a graphics card it takes long.
    const { top, bottom } = canvas.getBoundingClientRect();
    if (number === null || (bottom > 0 && top < innerHeight)) viewer.setHighlight(number);
    for (const item of $$("[data-material]")) {
      item.classList.toggle("lit", number !== null && Number(item.dataset.material) === number + 1);
    }
  };
  for (const item of $$("[data-material]")) {
    const number = Number(item.dataset.material) - 1;
    item.addEventListener("pointerenter", (event) => event.pointerType === "mouse" && light(number));
    item.addEventListener("pointerleave", () => light(null));
    item.addEventListener("focusin", (event) => event.target.matches(":focus-visible") && light(number));
    item.addEventListener("focusout", () => light(null));
  }

  /* The section. */

  const slider = $("#section-place"), flip = $("#section-flip"), words = $("#section-words");
  const ways = $$("input[name=section]");
  let towards = true; // the side towards the eye is taken away, as the eye was when a way was chosen
  const section = (event) => {
    const way = data.sections[ways.findIndex((input) => input.checked) - 1];
    slider.disabled = flip.disabled = !way;
    if (!way) {
      words.textContent = "";
      viewer.setClip(null);
      return;
    }
    if (ways.includes(event.target)) towards = viewer.faces(way.normal);
    const [low, high] = endsAlong(data, way.normal);
    const at = low + (Number(slider.value) / Number(slider.max)) * (high - low);
    const text = `${way.name} = ${mm(at - way.zero)} mm`;
    words.textContent = text;
    slider.setAttribute("aria-valuetext", text);
    viewer.setClip(way.normal, at, flip.checked === towards);
  };
  for (const input of [...ways, slider, flip]) input.addEventListener("input", section);

  /* Findings: a button in the list and a mark in the view for each that has a place. */

  const marks = data.findings.map((finding, number) => {
    const mark = document.createElement("span");
    mark.className = "mark";
    mark.textContent = finding.number;
    mark.addEventListener("click", () => choose(number));
    $("#marks").append(mark);
    return mark;
  });
  const buttons = $$("#findings button");
  function choose(number) {
    buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === number)));
    marks.forEach((mark, i) => mark.classList.toggle("chosen", i === number));
    viewer.flyTo(data.findings[number].place, data.findings[number].size);
    buttons[number].scrollIntoView({ block: "nearest" });
  }
  buttons.forEach((button, number) => button.addEventListener("click", () => choose(number)));

  /* Views, edges, and what follows every frame: marks, axes and scale. */

  for (const button of $$("[data-view]")) {
    button.addEventListener("click", () => viewer.setView(button.dataset.view));
  }
  $("#zoom-in").addEventListener("click", () => viewer.zoomBy(1.3));
  $("#zoom-out").addEventListener("click", () => viewer.zoomBy(1 / 1.3));
  $("#edges").addEventListener("change", (event) => viewer.setEdges(event.target.checked));

  const arms = $$("#axes g"), bar = $("#scale-bar"), length = $("#scale-words");
  viewer.onFrame(() => {
    data.findings.forEach((finding, i) => {
      const [x, y] = viewer.project(finding.place);
      marks[i].style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
      marks[i].classList.toggle("away", viewer.isCutAway(finding.place));
      marks[i].hidden = x < 0 || y < 0 || x > canvas.clientWidth || y > canvas.clientHeight;
    });
    viewer.axesOnScreen().forEach(([right, up, near], k) => {
      const arm = arms[k], far = near < -0.02;
      arm.firstElementChild.setAttribute("x2", (20 * right).toFixed(2));
      arm.firstElementChild.setAttribute("y2", (-20 * up).toFixed(2));
      arm.lastElementChild.setAttribute("x", (28 * right).toFixed(2));
      arm.lastElementChild.setAttribute("y", (-28 * up + 4).toFixed(2));
      arm.style.opacity = far ? 0.55 : 1;
    });
    const rough = 110 * viewer.mmPerPixel();
    const power = 10 ** Math.floor(Math.log10(rough));
    const round = power * [5, 2, 1].find((step) => step * power <= rough);
    bar.style.width = `${(round / viewer.mmPerPixel()).toFixed(1)}px`;
    length.textContent = `${Number(round.toPrecision(1))} mm`;
  });

  /* What lies under the pointer, once it rests. */

  const under = $("#under");
  let waiting = 0;
  const read = (event) => {
    const box = canvas.getBoundingClientRect();
    const found = viewer.pick(event.clientX - box.left, event.clientY - box.top);
    const shell = found && data.shells[found.shell];
    under.textContent = found
      ? viewer.describe?.(found) ?? `${[`${shell.number} ${shell.name}`, shell.modulus].filter(Boolean).join(", ")} at ` +
        `(${found.place.map((v, k) => mm(v - data.moved[k])).join(", ")}) mm`
      : "";
  };
  canvas.addEventListener("pointermove", (event) => {
    clearTimeout(waiting);
    if (event.buttons === 0) waiting = setTimeout(read, 60, event);
  });
  canvas.addEventListener("pointerleave", () => {
    clearTimeout(waiting);
    under.textContent = "";
  });
  stage.addEventListener("contextmenu", (event) => event.preventDefault());

  viewer.draw();
  document.documentElement.dataset.ready = performance.now().toFixed(0);
})();
