# A problem of Bundle Adjustment in the Large to COLMAP's cameras.txt,
# images.txt and points3D.txt in `folder`; bal_to_colmap.sh says what it holds.

function fail(what) {
  printf "%s: %s\n", FILENAME, what > "/dev/stderr"
  has_failed = 1
  exit 1
}

BEGIN { at = 0 }

# The file is one list of numbers, however its lines are broken; a byte order
# mark and carriage returns are none.
NR == 1 { sub(/^\357\273\277/, "") }
{
  gsub(/\r/, " ")
  for (i = 1; i <= NF; ++i) {
    if ($i !~ /^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$/) {
      fail("'" $i "' is no number")
    }
    take($i)
  }
}

# `at` numbers came before this one, which is kept as text: with its digits.
function take(number,    n, k) {
  if (at < 3) {
    count[at] = number + 0
  } else if ((n = at - 3) < 4 * count[2]) {
    take_observation(int(n / 4), n % 4, number)
  } else if ((n -= 4 * count[2]) < 9 * count[0]) {
    camera[int(n / 9), n % 9] = number
  } else if ((n -= 9 * count[0]) < 3 * count[1]) {
    k = int(n / 3)
    point[k] = point[k] " " number
  } else {
    fail("more numbers than cameras, points and observations have")
  }
  ++at
}

# Collects images' 2D points and the tracks.
function take_observation(o, part, number) {
  if (part < 2) {
    if (number + 0 != int(number) || number < 0 || number >= count[part]) {
      fail("observation " o " is of " (part ? "point " : "camera ") number \
           ", of " count[part])
    }
    seen[part] = number + 0
    return
  }
  size = number < 0 ? -number : number
  if (size + 0 > half[part]) half[part] = size + 0
  xy[part] = number
  if (part == 2) return
  x_of[o] = xy[2]
  y_of[o] = xy[3]
  point_of[o] = seen[1]
  of_camera[seen[0]] = of_camera[seen[0]] " " o
  track[seen[1]] = track[seen[1]] " " seen[0] + 1 " " num_2D[seen[0]]++ + 0
}

# The quaternion of diag(1, -1, -1) R, R turning by the vector's length about
# it: i (w + x i + y j + z k) = -x + w i - z j + y k.
function quaternion(c,    angle, s) {
  angle = sqrt(camera[c, 0] ^ 2 + camera[c, 1] ^ 2 + camera[c, 2] ^ 2)
  s = angle > 0 ? sin(angle / 2) / angle : 0.5
  return sprintf("%.17g %.17g %.17g %.17g", -s * camera[c, 0], cos(angle / 2),
                 -s * camera[c, 2], s * camera[c, 1])
}

END {
  if (has_failed) exit 1
  expected = 3 + 4 * count[2] + 9 * count[0] + 3 * count[1]
  if (at < 3 || at < expected) {
    fail(at + 0 " numbers found, " (at < 3 ? 3 : expected) " expected")
  }
  cx = int(half[2]) + 1
  cy = int(half[3]) + 1
  for (c = 0; c < count[0]; ++c) {
    if (!(camera[c, 6] > 0)) fail("camera " c " has no focal length above 0")
    print c + 1, "RADIAL", 2 * cx, 2 * cy, camera[c, 6], cx, cy, camera[c, 7], \
      camera[c, 8] > (folder "/cameras.txt")
    printf "%d %s %s %.17g %.17g %d camera%05d.jpg\n", c + 1, quaternion(c), \
      camera[c, 3], -camera[c, 4], -camera[c, 5], c + 1, c \
      > (folder "/images.txt")
    line = ""
    num = split(of_camera[c], own, " ")
    for (n = 1; n <= num; ++n) {
      o = own[n]
      line = line sprintf("%.17g %.17g %d ", x_of[o] + cx, cy - y_of[o], \
                          point_of[o] + 1)
    }
    print line > (folder "/images.txt")
  }
  printf "" > (folder "/points3D.txt")
  for (k = 0; k < count[1]; ++k) {
    if (track[k] == "") continue
    print k + 1 point[k] " 128 128 128 -1" track[k] > (folder "/points3D.txt")
  }
}
