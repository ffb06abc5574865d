// The tasks of "How to" stand open in the sidebar: most who come have one.
document.addEventListener("DOMContentLoaded", () => {
  for (const caption of document.querySelectorAll(".sidebar-tree .caption")) {
    if (caption.textContent.trim() !== "How to") continue;
    const box = caption.nextElementSibling?.querySelector(":scope > li > .toctree-checkbox");
    if (box) box.checked = true;
  }
});
