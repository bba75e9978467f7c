"use strict";
// A click on a heading sorts by its column, a second one the other way round. Numbers are sorted as such.
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  [...table.tHead.rows[0].cells].forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const down = heading.getAttribute("aria-sort") === "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", down ? "descending" : "ascending");
      const text = (row) => row.cells[column].textContent.trim();
      const order = (a, b) => {
        const [x, y] = [parseFloat(text(a)), parseFloat(text(b))];
        const numbers = heading.classList.contains("n") && !isNaN(x) && !isNaN(y);
        return numbers ? x - y : text(a).localeCompare(text(b), "en", { numeric: true });
      };
      const rows = [...body.rows].sort(order);
      body.append(...(down ? rows.reverse() : rows));
    });
  });
}
// What a mark or a cell tells stands in a line below its picture, for pointers, fingers and keys alike. Tab goes to a picture, the arrow
// keys from mark to mark within it.
let hinted = false;
for (const figure of document.querySelectorAll("figure.heat, figure.tracks, .roads figure")) {
  const line = figure.querySelector(".told");
  const marks = [...figure.querySelectorAll("[tabindex]:not(.scroll)")];
  const place = (mark) => mark.getBoundingClientRect();
  // How to get there is said once; the line of the other pictures keeps its place free.
  if (line && marks.length && !figure.closest(".roads")) {
    line.textContent = hinted ? "\u00a0" : "Point at a mark, or go there with Tab and the arrow keys: it tells its drives here.";
    line.classList.add("hint");
    hinted = true;
  }
  marks.forEach((mark, number) => {
    mark.setAttribute("tabindex", number === 0 ? "0" : "-1");
    const told = () => {
      if (!line) return;
      line.textContent = mark.getAttribute("aria-label");
      line.classList.remove("hint");
    };
    for (const event of ["mouseenter", "focus"]) mark.addEventListener(event, told);
    mark.addEventListener("keydown", (event) => {
      const [across, down] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key] ?? [0, 0];
      if (!across && !down) return;
      event.preventDefault();
      const here = place(mark);
      const away = (other) => {
        const there = place(other);
        const [x, y] = [there.left + there.width / 2 - here.left - here.width / 2, there.top + there.height / 2 - here.top - here.height / 2];
        const ahead = across ? x * across : y * down;
        return ahead > 2 ? ahead + 4 * Math.abs(across ? y : x) : Infinity;
      };
      const next = marks.reduce((best, other) => (away(other) < away(best) ? other : best), mark);
      if (next === mark) return;
      for (const other of marks) other.setAttribute("tabindex", other === next ? "0" : "-1");
      next.focus();
    });
  });
}
// A table that is wider than the window says so.
const hints = () => {
  for (const box of document.querySelectorAll(".scroll")) {
    const rest = box.scrollWidth - box.clientWidth;
    box.classList.toggle("cut", rest > 2 && box.scrollLeft < rest - 2);
    if (rest > 2 && !box.hasAttribute("tabindex")) box.setAttribute("tabindex", "0");
  }
};
for (const box of document.querySelectorAll(".scroll")) box.addEventListener("scroll", hints, { passive: true });
for (const part of document.querySelectorAll("details")) part.addEventListener("toggle", hints);
addEventListener("resize", hints);
hints();
