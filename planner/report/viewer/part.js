"use strict";
/* The steps of a loaded part's page: a slider takes the surface from one to the next. */

(() => {
  const viewer = window.planView;
  if (!viewer) return;
  const $ = (selector) => document.querySelector(selector);
  const data = JSON.parse($("#data").textContent);
  const [shell] = data.shells;
  const { buffer } = bytesOf($("#steps").textContent.trim());
  const wide = 6 * shell.points, each = wide + shell.points; // 16 bits a coordinate, 8 a value
  const stride = Math.ceil(each / 4) * 4;
  const frames = data.steps.map((_, k) => ({
    points: new Uint16Array(buffer, k * stride, 3 * shell.points),
    values: new Uint8Array(buffer, k * stride + wide, shell.points),
    scale: null,
  }));
  const scale = data.scale.map((colour) => new THREE.Color(colour));
  const slider = $("#step"), words = $("#step-words"), rows = [...document.querySelectorAll("[data-step]")];
  let faces = null;

  const show = () => {
    const k = Number(slider.value);
    viewer.setFrame(0, { ...frames[k], scale });
    words.textContent = data.steps[k];
    slider.setAttribute("aria-valuetext", data.steps[k]);
    for (const row of rows) row.classList.toggle("lit", Number(row.dataset.step) === k);
  };
  slider.addEventListener("input", show);
  $("#ghost").addEventListener("change", (event) => viewer.setGhost(0, event.target.checked));

  /* What lies under the pointer: the value at the nearest corner of the face. */

  viewer.describe = ({ face, place }) => {
    const where = `(${place.map(mm).join(", ")}) mm`;
    if (face === null) return `inside, at ${where}`;
    faces ??= decodeShells($("#geometry").textContent, data.shells)[0].faces;
    const { points, values } = frames[Number(slider.value)];
    const away = (v) => place.reduce((sum, p, i) => sum + (data.origin[i] + data.step * points[3 * v + i] - p) ** 2, 0);
    const nearest = [...faces.subarray(face, face + 3)].sort((a, b) => away(a) - away(b))[0];
    const value = (values[nearest] / 255) * data.top;
    return `strain / break ${value.toPrecision(2)}, now at ${where}`;
  };

  show();
})();
