"use strict";
/* A design's page: a slider takes the part from rest to its full load, case by case; what is wanted
   of its surface is drawn over it, and what is left of that as colours. */

(() => {
  const viewer = window.planView;
  if (!viewer) return;
  const $ = (selector) => document.querySelector(selector);
  const data = JSON.parse($("#data").textContent);
  const { course } = data;
  const { buffer } = bytesOf($("#course-frames").textContent.trim());
  let at = 0;
  const frames = course.frames.map(() =>
    data.shells.slice(0, course.printed).map(({ points }) => {
      const frame = { points: new Uint16Array(buffer, at, 3 * points), values: new Uint8Array(buffer, at + 6 * points, points) };
      at += Math.ceil((7 * points) / 4) * 4;
      return frame;
    }),
  );
  const scale = course.scale.map((colour) => new THREE.Color(colour));
  const slider = $("#course-step"), words = $("#course-step-words"), wanted = $("#course-wanted"), left = $("#course-left");
  const shapes = data.shells.slice(course.printed).map((_, k) => course.printed + k);
  for (const number of shapes) viewer.setShown(number, false);

  const show = () => {
    const k = Number(slider.value), { text, shape } = course.frames[k];
    frames[k].forEach((frame, number) => {
      const plain = Array(256).fill(new THREE.Color(data.shells[number].colour));
      viewer.setFrame(number, { ...frame, scale: left?.checked ? scale : plain });
    });
    for (const number of shapes) viewer.setGhost(number, Boolean(wanted.checked) && number === shape);
    words.textContent = text;
    slider.setAttribute("aria-valuetext", text);
  };
  for (const input of [slider, wanted, left]) input?.addEventListener("input", show);
  show();
})();
