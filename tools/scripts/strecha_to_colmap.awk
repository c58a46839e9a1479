# Files NAME.camera of Strecha et al. to COLMAP's cameras.txt and images.txt,
# whose names are in the variables `cameras` and `images`;
# strecha_to_colmap.sh says what the files hold.

function fail(what) {
  printf "%s: %s\n", file, what > "/dev/stderr"
  has_failed = 1
  exit 1
}

# Sets q[1..4], the unit quaternion (w, x, y, z) of the rotation R[row, column]:
# from its largest entry, so that nothing small is divided by.
function quaternion(R, q,    i, largest, n) {
  # The four squares, times four.
  n[1] = 1 + R[1, 1] + R[2, 2] + R[3, 3]
  n[2] = 1 + R[1, 1] - R[2, 2] - R[3, 3]
  n[3] = 1 - R[1, 1] + R[2, 2] - R[3, 3]
  n[4] = 1 - R[1, 1] - R[2, 2] + R[3, 3]
  largest = 1
  for (i = 2; i <= 4; ++i) if (n[i] > n[largest]) largest = i
  # The products of two entries, times four.
  n[1, 2] = R[3, 2] - R[2, 3]; n[3, 4] = R[3, 2] + R[2, 3]
  n[1, 3] = R[1, 3] - R[3, 1]; n[2, 4] = R[1, 3] + R[3, 1]
  n[1, 4] = R[2, 1] - R[1, 2]; n[2, 3] = R[2, 1] + R[1, 2]
  for (i = 1; i <= 4; ++i) {
    q[i] = i == largest ? n[i] : i < largest ? n[i, largest] : n[largest, i]
    q[i] /= 2 * sqrt(n[largest])
  }
}

# R[row, column]: how far R R' is from the identity.
function defect(R,    i, j, k, sum, worst) {
  for (i = 1; i <= 3; ++i)
    for (j = 1; j <= 3; ++j) {
      sum = i == j ? -1 : 0
      for (k = 1; k <= 3; ++k) sum += R[i, k] * R[j, k]
      if (sum * sum > worst * worst) worst = sum
    }
  return worst < 0 ? -worst : worst
}

# Writes the camera that `value` holds, row by row.
function write_camera(    name, R, q, i, j, t) {
  if (num_values != 26) fail(num_values " numbers found, 26 expected")
  if (value[10] || value[11] || value[12]) fail("distortion is not zero")
  # cam_from_world is the transpose of what the file holds.
  for (i = 1; i <= 3; ++i)
    for (j = 1; j <= 3; ++j) R[j, i] = value[12 + 3 * (i - 1) + j]
  if (defect(R) > 1e-4) fail("the three rows after the zeros are no rotation")
  quaternion(R, q)
  for (i = 1; i <= 3; ++i)
    t[i] = -(R[i, 1] * value[22] + R[i, 2] * value[23] + R[i, 3] * value[24])
  name = file
  sub(/.*\//, "", name)
  sub(/\.camera$/, "", name)
  ++id
  printf "%d PINHOLE %d %d %.17g %.17g %.17g %.17g\n", id, value[25], \
    value[26], value[1], value[5], value[3], value[6] > cameras
  printf "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %d %s\n\n", id, \
    q[1], q[2], q[3], q[4], t[1], t[2], t[3], id, name > images
}

FNR == 1 && NR > 1 { write_camera() }
FNR == 1 { file = FILENAME; num_values = 0; sub(/^\357\273\277/, "") }
{ gsub(/\r/, " ") }
{ for (field = 1; field <= NF; ++field) value[++num_values] = $field }
END { if (!has_failed) write_camera() }
