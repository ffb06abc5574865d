// The model in three dimensions beside the panels, in a frame of its own, at the time of the cursor.
"use strict";
const Scene = (() => ({start: (box, button) => { button.hidden = true; box.hidden = true; }}))();
