// The model in three dimensions beside the panels: the page of `animate` in a frame, its slider and the cursor at one time.
"use strict";
const Scene = (() => {
  const self = {};
  let frame, box, muted = 0;

  const slider = () => frame?.contentDocument?.querySelector("[role=slider]");
  const track = () => frame?.contentDocument?.querySelector(".mantine-Slider-track");

  function drawable() {
    const canvas = document.createElement("canvas");
    return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl"));
  }

  function say(words) {
    const said = document.createElement("p");
    said.className = "said";
    said.textContent = words;
    box.replaceChildren(said);
  }

  // the slider of the frame takes presses of the mouse only
  self.go = (time) => {
    const rail = track(), thumb = slider();
    if (!rail || time === null) return;
    const {left, width, top, height} = rail.getBoundingClientRect(), view = frame.contentWindow;
    const share = (time - Data.scene.start) / Data.scene.speed / Number(thumb.getAttribute("aria-valuemax"));
    if (!(share >= 0 && share <= 1)) return;
    const place = {bubbles: true, clientX: left + share * width, clientY: top + height / 2, button: 0, buttons: 1};
    muted = performance.now() + 400;
    rail.dispatchEvent(new view.MouseEvent("mousedown", place));
    frame.contentDocument.dispatchEvent(new view.MouseEvent("mouseup", place));
  };

  function follow() {
    const thumb = slider();
    if (!thumb) return setTimeout(follow, 200);
    frame.contentDocument.querySelector(".mantine-ActionIcon-root")?.click(); // it begins to play by itself
    setTimeout(() => {
      new MutationObserver(() => {
        if (performance.now() < muted) return;
        Panels.pin(Data.scene.start + Data.scene.speed * Number(slider().getAttribute("aria-valuenow")), "a", true);
      }).observe(thumb, {attributes: true, attributeFilter: ["aria-valuenow"]});
      frame.contentDocument.querySelector(".mantine-Notification-closeButton")?.click();
      self.go(Panels.a ?? Data.scene.start);
      frame.dataset.ready = "yes";
    }, 300);
  }

  function open() {
    if (!drawable()) return say("This browser has no WebGL, so that the model cannot be drawn; the panels need none.");
    frame = document.createElement("iframe");
    frame.title = "the model in motion";
    frame.srcdoc = JSON.parse(document.getElementById("scene-page").textContent);
    box.replaceChildren(frame);
    follow();
  }

  self.start = (element, button) => {
    box = element;
    const {scene} = Data;
    box.hidden = !scene;
    button.hidden = !scene;
    if (!scene) return;
    button.onclick = () => (box.hidden = !box.hidden);
    if (scene.words) say(scene.words);
    else open();
    Panels.onTime = self.go;
  };
  return self;
})();
