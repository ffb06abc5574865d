// The model in three dimensions beside the panels: its slider and the cursor at one time.
"use strict";
const Scene = (() => {
  const self = {};

  self.go = (time) => { if (time !== null) Frame.go((time - Data.scene.start) / Data.scene.speed); };
  const ready = () => self.go(Panels.a ?? Data.scene.start);
  const moved = (seconds) => Panels.pin(Data.scene.start + Data.scene.speed * seconds, "a", true);

  self.start = (element, button) => {
    const {scene} = Data;
    element.hidden = !scene;
    button.hidden = !scene;
    if (!scene) return;
    button.onclick = () => (element.hidden = !element.hidden);
    if (scene.words) Frame.say(element, scene.words);
    else if (!Frame.open(element, ready, moved))
      Frame.say(element, "This browser has no WebGL, so that the model cannot be drawn; the panels need none.");
    Panels.onTime = self.go;
  };
  return self;
})();
