# Draws one of the figures of docs/method as SVG: awk -v figure=NAME, NAME
# being sweep, matrix or working_set. All show the same small problem: five
# frames, eight points, and the observations below.

function open_svg(width, height) {
  printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" ",
      width, height
  print "font-family=\"sans-serif\" font-size=\"13\" fill=\"#333\">"
  printf "<rect width=\"%d\" height=\"%d\" fill=\"white\"/>\n", width, height
}
function text(x, y, anchor, content) {
  printf "<text x=\"%g\" y=\"%g\" text-anchor=\"%s\">%s</text>\n", x, y, anchor,
      content
}
function line(x1, y1, x2, y2, color, width) {
  printf "<line x1=\"%g\" y1=\"%g\" x2=\"%g\" y2=\"%g\" stroke=\"%s\" ", x1, y1,
      x2, y2, color
  printf "stroke-width=\"%g\"/>\n", width
}
function box(x, y, width, height, color) {
  printf "<rect x=\"%g\" y=\"%g\" width=\"%g\" height=\"%g\" fill=\"%s\"/>\n",
      x, y, width, height, color
}
function disc(x, y, radius, color) {
  printf "<circle cx=\"%g\" cy=\"%g\" r=\"%g\" fill=\"%s\"/>\n", x, y, radius,
      color
}

function frame_x(f) { return left + 26 + 56 * (f - 1) }
function point_x(k) { return left + 8 + 37 * (k - 1) }

# Frames above, points below, a line for every observation. Of the three arrays
# by frame, point and observation, "" is drawn pale.
function graph(frame_color, point_color, edge_color,    k, f) {
  for (k = 1; k <= 8; ++k) {
    for (f = 1; f <= 5; ++f) {
      if (!sees[k, f]) continue
      line(frame_x(f), 78, point_x(k), 168,
           edge_color[k, f] ? edge_color[k, f] : pale,
           edge_color[k, f] ? 2 : 1)
    }
  }
  for (f = 1; f <= 5; ++f) {
    box(frame_x(f) - 11, 62, 22, 16, frame_color[f] ? frame_color[f] : pale)
  }
  for (k = 1; k <= 8; ++k) {
    disc(point_x(k), 172, 7, point_color[k] ? point_color[k] : pale)
  }
}

function draw_sweep(    k, f, frames, points, edges) {
  open_svg(680, 230)
  left = 20
  text(left, 24, "start", "1. every point, the frames fixed (Int)")
  points[4] = red
  for (f = 1; f <= 5; ++f) if (sees[4, f]) frames[f] = edges[4, f] = blue
  graph(frames, points, edges)
  text(left, 208, "start", "one point moves: its observations decide")
  split("", frames)
  split("", points)
  split("", edges)
  left = 370
  text(left, 24, "start", "2. every frame, the points fixed (Res)")
  frames[3] = red
  for (k = 1; k <= 8; ++k) if (sees[k, 3]) points[k] = edges[k, 3] = blue
  graph(frames, points, edges)
  text(left, 208, "start", "one frame moves: its observations decide")
}

function draw_matrix(    k, f, g, row, together) {
  open_svg(680, 330)
  text(110, 24, "middle", "8 points")
  text(250, 24, "middle", "5 frames")
  for (k = 1; k <= 8; ++k) {
    for (f = 1; f <= 5; ++f) {
      if (!sees[k, f]) continue
      box(31 + 20 * (k - 1), 34 + 12 * row, 18, 10, blue)
      box(201 + 20 * (f - 1), 34 + 12 * row, 18, 10, red)
      ++row
    }
  }
  line(195, 30, 195, 38 + 12 * row, "#999", 1)
  text(165, 316, "middle", "A: one row of blocks per observation")
  text(390, 140, "middle", "each point's rows")
  text(390, 158, "middle", "by QR: I - QQ'")
  text(390, 182, "middle", "&#8594;")
  for (f = 1; f <= 5; ++f) {
    for (g = 1; g <= 5; ++g) {
      together = 0
      for (k = 1; k <= 8; ++k) together += sees[k, f] * sees[k, g]
      box(481 + 30 * (g - 1), 81 + 30 * (f - 1), 28, 28,
          together ? red : "#eeeeee")
    }
  }
  text(555, 64, "middle", "5 frames")
  text(555, 252, "middle", "a block where two frames")
  text(555, 270, "middle", "see a point in common")
}

function draw_working_set(    k, f, frames, points, edges, errors, top, height) {
  open_svg(680, 330)
  left = 40
  split("1 0.4 0.3 0.94 0.5 0.6 0.35 0.2", errors, " ")
  split("", points)
  points[1] = points[4] = red
  points[3] = points[6] = points[7] = blue
  for (f = 1; f <= 5; ++f) {
    frames[f] = "#666666"
    for (k = 1; k <= 8; ++k) if (points[k]) edges[k, f] = points[k]
  }
  graph(frames, points, edges)
  top = 196
  for (k = 1; k <= 8; ++k) {
    height = 90 * errors[k]
    box(point_x(k) - 9, top + 90 - height, 18, height,
        points[k] ? points[k] : pale)
  }
  line(left - 12, top, point_x(8) + 20, top, "#333", 1)
  line(left - 12, top + 9, point_x(8) + 20, top + 9, "#999", 1)
  text(point_x(8) + 26, top, "start", "cost")
  text(point_x(8) + 26, top + 18, "start", "0.9 of it")
  text(left, 308, "start", "each point's largest residual")
  disc(410, 68, 7, red)
  text(426, 73, "start", "in the set for its residual")
  disc(410, 98, 7, blue)
  text(426, 103, "start", "in the set as a tie: every frame")
  text(426, 120, "start", "keeps two observations (20 in fact)")
  disc(410, 145, 7, pale)
  text(426, 150, "start", "outside: placed afterwards")
}

BEGIN {
  red = "#c0392b"
  blue = "#1f5fa8"
  pale = "#c8ccd0"
  split("123 12 123 234 34 345 45 25", tracks, " ")
  for (k = 1; k <= 8; ++k) {
    for (f = 1; f <= 5; ++f) sees[k, f] = index(tracks[k], f) > 0
  }
  if (figure == "sweep") draw_sweep()
  if (figure == "matrix") draw_matrix()
  if (figure == "working_set") draw_working_set()
  print "</svg>"
}
