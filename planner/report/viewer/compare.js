"use strict";
/* Two plans side by side: what is done to one view is done to the other. The page stands without it. */

(() => {
  const $$ = (selector) => [...document.querySelectorAll(selector)];
  const read = (id) => document.getElementById(id).textContent;
  let sides;
  try {
    sides = ["A", "B"].map((side) => {
      const canvas = document.getElementById(`view-${side}`), data = JSON.parse(read(`data-${side}`));
      const shells = decodeShells(read(`geometry-${side}`), data.shells);
      return { data, viewer: createViewer(canvas, { ...data, shells }) };
    });
  } catch (error) {
    console.error(error);
    for (const item of $$(".no-view")) item.hidden = false;
    document.documentElement.dataset.ready = "without-view";
    return;
  }
  window.planViews = sides.map(({ viewer }) => viewer);
  for (const item of $$("[data-needs-view]")) item.hidden = false;
  for (const { viewer } of sides) followTheme(viewer);

  /* One camera for both: whoever is moved takes the other along. */

  const looks = []; // as last set
  const looked = ({ viewer }) => JSON.stringify(viewer.look(), (_, v) => (typeof v === "number" ? Number(v.toPrecision(6)) : v));
  function link(from) {
    const look = looked(sides[from]), to = 1 - from;
    if (look === looks[from]) return;
    looks[from] = look;
    sides[to].viewer.setLook(sides[from].viewer.look());
    looks[to] = looked(sides[to]);
  }
  const larger = sides[0].viewer.mmPerPixel() >= sides[1].viewer.mmPerPixel() ? 0 : 1;
  looks[1 - larger] = looked(sides[1 - larger]);
  link(larger);
  sides.forEach(({ viewer }, side) => viewer.onFrame(() => link(side)));

  /* Materials by their numbers: on and off, and pointed out from wherever they are named. */

  const each = (number, act) => {
    for (const { data, viewer } of sides) act(viewer, data.shells.findIndex((shell) => shell.number === number));
  };
  for (const item of $$("#materials li")) {
    const number = Number(item.dataset.material), box = item.querySelector("input");
    box.addEventListener("change", () => each(number, (viewer, shell) => shell >= 0 && viewer.setShown(shell, box.checked)));
  }
  const light = (number) => {
    each(number, (viewer, shell) => viewer.setHighlight(shell >= 0 ? shell : null));
    for (const item of $$("[data-material]")) item.classList.toggle("lit", Number(item.dataset.material) === number);
  };
  for (const item of $$("[data-material]")) {
    item.addEventListener("pointerenter", (event) => event.pointerType === "mouse" && light(Number(item.dataset.material)));
    item.addEventListener("pointerleave", () => light(null));
    item.addEventListener("focusin", (event) => event.target.matches(":focus-visible") && light(Number(item.dataset.material)));
    item.addEventListener("focusout", () => light(null));
  }

  /* One section for both, at one place in the coordinates of the parts' own files. */

  const slider = document.getElementById("section-place"), flip = document.getElementById("section-flip");
  const words = document.getElementById("section-words"), ways = $$("input[name=section]");
  let towards = true; // the side towards the eye is taken away, as the eye was when a way was chosen
  const section = (event) => {
    const k = ways.findIndex((input) => input.checked) - 1;
    slider.disabled = flip.disabled = k < 0;
    if (k < 0) {
      words.textContent = "";
      for (const { viewer } of sides) viewer.setClip(null);
      return;
    }
    const cuts = sides.map(({ data }) => data.sections[k]);
    if (ways.includes(event.target)) towards = sides[0].viewer.faces(cuts[0].normal);
    const ends = sides.map(({ data }, i) => endsAlong(data, cuts[i].normal).map((end) => end - cuts[i].zero));
    const low = Math.min(ends[0][0], ends[1][0]), high = Math.max(ends[0][1], ends[1][1]);
    const at = low + (Number(slider.value) / Number(slider.max)) * (high - low);
    words.textContent = `${cuts[0].name} = ${mm(at)} mm`;
    slider.setAttribute("aria-valuetext", words.textContent);
    sides.forEach(({ viewer }, i) => viewer.setClip(cuts[i].normal, at + cuts[i].zero, flip.checked === towards));
  };
  for (const input of [...ways, slider, flip]) input.addEventListener("input", section);

  for (const { viewer } of sides) viewer.draw();
  document.documentElement.dataset.ready = performance.now().toFixed(0);
})();
