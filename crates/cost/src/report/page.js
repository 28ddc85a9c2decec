// What a link leads to may be folded.
function unfold() {
  const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target) return;
  for (let at = target; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
  target.scrollIntoView();
}
addEventListener("hashchange", unfold);
unfold();
// Paper shows what is folded.
addEventListener("beforeprint", () => { for (const part of document.querySelectorAll("details")) part.open = true; });

// The card beside the chart: what the list of pictures says of a point, when it is pointed at or stepped to.
const card = document.getElementById("card");
function show(name) {
  const entry = document.querySelector(`article[data-name="${CSS.escape(name)}"]`);
  if (!entry) return;
  const parts = [entry.querySelector("h3"), ...[...entry.querySelectorAll("img")].slice(0, 2), entry.querySelector(".figures"), entry.querySelector(".given")];
  card.replaceChildren(...parts.map((part) => {
    const copy = part.cloneNode(true);
    copy.removeAttribute("loading");
    return copy;
  }));
}
for (const point of document.querySelectorAll("a.point")) {
  for (const event of ["pointerenter", "focus"]) point.addEventListener(event, () => show(point.dataset.point));
}

// The line between a picture and the reference.
const slider = document.querySelector(".slider");
slider?.querySelector("input")?.addEventListener("input", (event) => slider.style.setProperty("--at", `${event.target.value}%`));
document.getElementById("left")?.addEventListener("change", (event) => { slider.querySelector(".over").src = event.target.value; });

for (const button of document.querySelectorAll("button.copy")) {
  button.addEventListener("click", async () => {
    await navigator.clipboard.writeText(button.previousElementSibling.textContent);
    button.textContent = "copied";
    setTimeout(() => { button.textContent = "copy"; }, 1500);
  });
}

for (const field of document.querySelectorAll("input.filter")) {
  const of = document.getElementById(field.dataset.of);
  field.addEventListener("input", () => {
    const word = field.value.toLowerCase();
    for (const entry of of.querySelectorAll("tbody tr, article")) entry.hidden = !entry.textContent.toLowerCase().includes(word);
  });
}

for (const table of document.querySelectorAll("table.sortable")) {
  table.querySelectorAll("thead th").forEach((head, column) => {
    head.querySelector("button").addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of table.querySelectorAll("thead th")) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const value = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent;
      const order = (a, b) => {
        const [x, y] = [value(a), value(b)];
        return isNaN(x) || isNaN(y) ? x.localeCompare(y) : x - y;
      };
      const rows = [...table.tBodies[0].rows].sort((a, b) => (down ? -order(a, b) : order(a, b)));
      table.tBodies[0].replaceChildren(...rows);
    });
  });
}
