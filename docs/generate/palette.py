"""The colours of the drawings in docs/images."""

INK, GREY, LIGHT = "#20262e", "#7a8490", "#d9dee4"
ROBOT, RING, DANGER, GOOD = "#3a6ea5", "#e8a33d", "#c8443c", "#3f8f5b"
HIDDEN, REMEMBERED = "#8a4fb0", "#b3760a"
