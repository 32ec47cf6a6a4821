"use strict";
// A link opens the section that it leads to; paper shows all but what of the appendix is closed.
const opened = () => {
  const section = document.getElementById(location.hash.slice(1));
  if (section && section.tagName === "DETAILS") { section.open = true; section.scrollIntoView(); }
};
window.addEventListener("hashchange", opened);
opened();
window.addEventListener("beforeprint", () => {
  for (const section of document.querySelectorAll("details:not(.appendix)")) section.open = true;
});
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  table.querySelectorAll("thead th").forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      for (const other of table.querySelectorAll("thead th")) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const key = (row) => row.cells[column].textContent.trim();
      const number = (text) => parseFloat(text.replace("\u2212", "-"));
      const rows = [...body.rows].sort((a, b) => {
        const [s, t] = [key(a), key(b)];
        const [x, y] = [number(s), number(t)];
        const order = isNaN(x) || isNaN(y) ? s.localeCompare(t) : x - y;
        return up ? order : -order;
      });
      body.append(...rows);
    });
  });
}
// The value under the pointer: the map's colour, found again in the colour bar of the same drawing.
const box = document.createElement("div");
box.id = "value";
document.body.append(box);
const pixels = (image) => {
  if (!image.ready) {
    image.ready = new Promise((done) => {
      const copy = new Image();
      copy.onload = () => {
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [copy.naturalWidth, copy.naturalHeight];
        const context = canvas.getContext("2d", { willReadFrequently: true });
        context.drawImage(copy, 0, 0);
        done(context.getImageData(0, 0, canvas.width, canvas.height));
      };
      copy.src = image.getAttribute("href");
    });
  }
  return image.ready;
};
for (const image of document.querySelectorAll("image.map")) {
  const bar = image.nextElementSibling;
  const [low, high] = [Number(image.dataset.low), Number(image.dataset.high)];
  image.addEventListener("pointermove", async (event) => {
    const frame = image.getBoundingClientRect();
    const [map, ramp] = await Promise.all([pixels(image), pixels(bar)]);
    const x = Math.min(map.width - 1, Math.floor(((event.clientX - frame.left) / frame.width) * map.width));
    const y = Math.min(map.height - 1, Math.floor(((event.clientY - frame.top) / frame.height) * map.height));
    const at = 4 * (y * map.width + x);
    if (x < 0 || y < 0 || map.data[at + 3] === 0) { box.style.display = "none"; return; }
    let best = 0, least = Infinity;
    for (let k = 0; k < ramp.width; k++) {
      let distance = 0;
      for (let c = 0; c < 3; c++) distance += (ramp.data[4 * k + c] - map.data[at + c]) ** 2;
      if (distance < least) { least = distance; best = k; }
    }
    const end = best === 0 ? "\u2264 " : best === ramp.width - 1 ? "\u2265 " : "";
    const value = low + ((high - low) * best) / (ramp.width - 1);
    box.textContent = end + value.toPrecision(3) + " " + image.dataset.unit;
    box.style.display = "block";
    box.style.left = Math.min(event.clientX + 14, window.innerWidth - 110) + "px";
    box.style.top = Math.max(event.clientY - 30, 4) + "px";
  });
  image.addEventListener("pointerleave", () => { box.style.display = "none"; });
}
