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
