// A page of `animate` in a frame: its slider is moved, and listened to, from outside.
"use strict";
const Frame = (() => {
  const self = {}, FINE = 1e6; // places of the slider, where its own width has a few hundred
  let frame, muted = 0;

  const slider = () => frame?.contentDocument?.querySelector("[role=slider]");
  const track = () => frame?.contentDocument?.querySelector(".mantine-Slider-track");
  const drawable = () => {
    const canvas = document.createElement("canvas");
    return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl"));
  };

  self.say = (box, words) => {
    const said = document.createElement("p");
    said.className = "said";
    said.textContent = words;
    box.replaceChildren(said);
  };

  // seconds of the film; the slider takes presses of the mouse only
  self.go = (seconds) => {
    const rail = track(), thumb = slider();
    if (!rail) return;
    const share = seconds / Number(thumb.getAttribute("aria-valuemax"));
    if (!(share >= 0 && share <= 1)) return;
    const place = {bubbles: true, clientX: Math.round(share * FINE), button: 0, buttons: 1};
    muted = performance.now() + 400;
    rail.dispatchEvent(new frame.contentWindow.MouseEvent("mousedown", place));
    frame.contentDocument.dispatchEvent(new frame.contentWindow.MouseEvent("mouseup", place));
  };

  // what the slider measures with the next picture: itself where a hand presses it, FINE places where `go` does
  function refine(rail) {
    let byHand = true;
    frame.contentDocument.addEventListener("mousedown", (event) => (byHand = event.isTrusted), true);
    for (const part of [rail, rail.parentElement, rail.closest(".mantine-Slider-root")]) {
      const own = part.getBoundingClientRect.bind(part);
      part.getBoundingClientRect = () => (byHand ? own() : new DOMRect(0, own().top, FINE, own().height));
    }
  }

  // without its own slider, where sliders of this page move it
  self.alone = () => { slider().closest(".mantine-Paper-root").style.visibility = "hidden"; };

  function follow(ready, moved) {
    const thumb = slider();
    if (!thumb) return setTimeout(follow, 200, ready, moved);
    frame.contentDocument.querySelector(".mantine-ActionIcon-root")?.click(); // it begins to play by itself
    setTimeout(() => {
      new MutationObserver(() => {
        if (performance.now() >= muted) moved(Number(slider().getAttribute("aria-valuenow")));
      }).observe(thumb, {attributes: true, attributeFilter: ["aria-valuenow"]});
      frame.contentDocument.querySelector(".mantine-Notification-closeButton")?.click();
      refine(track());
      ready();
      frame.dataset.ready = "yes";
    }, 300);
  }

  // false where the browser cannot draw it
  self.open = (box, ready, moved) => {
    if (!drawable()) return false;
    frame = document.createElement("iframe");
    frame.title = "the model in motion";
    frame.srcdoc = JSON.parse(document.getElementById("scene-page").textContent);
    box.replaceChildren(frame);
    follow(ready, moved);
    return true;
  };
  return self;
})();
