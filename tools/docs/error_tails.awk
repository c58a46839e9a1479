# Two files of pixel errors, one per line and largest first, to an SVG of their
# tails: the number of observations whose error exceeds x, on a logarithmic
# axis.

FNR == 1 { ++file }
{ error[file, FNR] = $1; count[file] = FNR }

# The larger of two numbers.
function max(a, b) { return a > b ? a : b }

function x_of(error_px) { return left + (right - left) * error_px / x_end }
function y_of(n) { return bottom - (bottom - top) * log(n) / log(y_end) }

function text(x, y, anchor, content, attributes) {
  printf "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" %s>%s</text>\n",
      x, y, anchor, attributes, content
}

function line(x1, y1, x2, y2, attributes) {
  printf "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" %s/>\n",
      x1, y1, x2, y2, attributes
}

function draw_axes(    x, n) {
  for (x = 0; x <= x_end; ++x) {
    line(x_of(x), top, x_of(x), bottom, "stroke=\"#ddd\"")
    text(x_of(x), bottom + 18, "middle", x)
  }
  for (n = 1; n <= y_end; n *= 10) {
    line(left, y_of(n), right, y_of(n), "stroke=\"#ddd\"")
    text(left - 8, y_of(n) + 4, "end", n)
  }
  text((left + right) / 2, bottom + 40, "middle", "x: reprojection error, pixels")
  text(left, top - 14, "start", "observations with an error above x")
}

# The tail of file f; of ranks that lie close on the axis, one is enough.
function draw_tail(f, color,    n) {
  printf "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"2\" points=\"",
      color
  for (n = 1; n <= count[f]; n = max(n + 1, int(n * 1.03))) {
    printf "%.1f,%.1f ", x_of(error[f, n]), y_of(n)
  }
  print "\"/>"
  line(x_of(error[f, 1]), bottom, x_of(error[f, 1]), bottom - 22,
       "stroke=\"" color "\" stroke-width=\"2\"")
}

function label(f, y, color, name) {
  text(right - 8, y, "end", sprintf("%s: at most %.2f px", name, error[f, 1]),
       "fill=\"" color "\" font-weight=\"bold\"")
}

END {
  left = 64; right = 616; top = 40; bottom = 300
  x_end = int(max(error[1, 1], error[2, 1])) + 1
  y_end = max(count[1], count[2])
  printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 640 352\" "
  print "font-family=\"sans-serif\" font-size=\"13\" fill=\"#333\">"
  print "<rect width=\"640\" height=\"352\" fill=\"white\"/>"
  draw_axes()
  draw_tail(1, "#c0392b")
  draw_tail(2, "#1f5fa8")
  label(1, top + 22, "#c0392b", "COLMAP")
  label(2, top + 42, "#1f5fa8", "KROT")
  print "</svg>"
}
