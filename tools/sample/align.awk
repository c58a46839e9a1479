# Aligns a COLMAP text model with ground_truth.txt and measures what is left.
#
# Input files, in this order: ground_truth.txt, cameras.txt, images.txt.
# The similarity is Horn's closed form (J. Opt. Soc. Am. A 4(4), 1987): the
# rotation is the eigenvector of the largest eigenvalue of a symmetric 4 x 4
# matrix, the scale the ratio of the spreads about the centroids. Only the
# centres determine it, so the rotations are an independent check.
# Works in any POSIX awk. Exit code 1 if a limit of check.sh is exceeded.

function abs(x) { return x < 0 ? -x : x }

# R[row, column] of the unit quaternion (w, x, y, z), normalised first.
function rotation(w, x, y, z, R,    n) {
  n = sqrt(w * w + x * x + y * y + z * z)
  w /= n; x /= n; y /= n; z /= n
  R[1, 1] = 1 - 2 * (y * y + z * z)
  R[1, 2] = 2 * (x * y - w * z)
  R[1, 3] = 2 * (x * z + w * y)
  R[2, 1] = 2 * (x * y + w * z)
  R[2, 2] = 1 - 2 * (x * x + z * z)
  R[2, 3] = 2 * (y * z - w * x)
  R[3, 1] = 2 * (x * z - w * y)
  R[3, 2] = 2 * (y * z + w * x)
  R[3, 3] = 1 - 2 * (x * x + y * y)
}

# Keeps the pose of a line "NAME QW QX QY QZ TX TY TZ": rotation and centre -R't.
function store(rotations, centres, name, w, x, y, z, t1, t2, t3,    R, i, j) {
  rotation(w, x, y, z, R)
  for (i = 1; i <= 3; ++i) {
    for (j = 1; j <= 3; ++j) rotations[name, i, j] = R[i, j]
    centres[name, i] = -(R[1, i] * t1 + R[2, i] * t2 + R[3, i] * t3)
  }
}

# Moves the centroid of the common images' centres to zero and returns their
# RMS distance to it.
function centre_and_spread(centres,    name, i, mean, sum) {
  for (i = 1; i <= 3; ++i) {
    mean = 0
    for (name in common) mean += centres[name, i] / num_common
    for (name in common) {
      centres[name, i] -= mean
      sum += centres[name, i] ^ 2
    }
  }
  return sqrt(sum / num_common)
}

# Q := the rotation that takes the model's centred centres onto the true ones.
function horn(Q,    name, i, j, S, N, q, p, n, step, shift) {
  for (i = 1; i <= 3; ++i)
    for (j = 1; j <= 3; ++j)
      for (name in common)
        S[i, j] += model_centre[name, i] * true_centre[name, j]
  N[1, 1] = S[1, 1] + S[2, 2] + S[3, 3]
  N[1, 2] = N[2, 1] = S[2, 3] - S[3, 2]
  N[1, 3] = N[3, 1] = S[3, 1] - S[1, 3]
  N[1, 4] = N[4, 1] = S[1, 2] - S[2, 1]
  N[2, 2] = S[1, 1] - S[2, 2] - S[3, 3]
  N[2, 3] = N[3, 2] = S[1, 2] + S[2, 1]
  N[2, 4] = N[4, 2] = S[3, 1] + S[1, 3]
  N[3, 3] = -S[1, 1] + S[2, 2] - S[3, 3]
  N[3, 4] = N[4, 3] = S[2, 3] + S[3, 2]
  N[4, 4] = -S[1, 1] - S[2, 2] + S[3, 3]
  # Power iteration; the shift makes the largest eigenvalue the dominant one.
  for (i = 1; i <= 4; ++i)
    for (j = 1; j <= 4; ++j) shift += abs(N[i, j])
  for (i = 1; i <= 4; ++i) q[i] = i
  for (step = 0; step < 10000; ++step) {
    n = 0
    for (i = 1; i <= 4; ++i) {
      p[i] = shift * q[i]
      for (j = 1; j <= 4; ++j) p[i] += N[i, j] * q[j]
      n += p[i] ^ 2
    }
    for (i = 1; i <= 4; ++i) q[i] = p[i] / sqrt(n)
  }
  rotation(q[1], q[2], q[3], q[4], Q)
}

# RMS distance of Q (true spread / model spread) model centre to true centre.
function centre_rms(Q, scale,    name, i, sum, moved) {
  for (name in common)
    for (i = 1; i <= 3; ++i) {
      moved = scale * (Q[i, 1] * model_centre[name, 1] + \
                       Q[i, 2] * model_centre[name, 2] + \
                       Q[i, 3] * model_centre[name, 3])
      sum += (moved - true_centre[name, i]) ^ 2
    }
  return sqrt(sum / num_common)
}

# Largest angle between R_model Q' and R_true, degrees: from the Frobenius norm
# of their difference, 2 sqrt(2) sin(angle / 2), which is exact for small ones.
function largest_angle(Q,    name, i, j, k, moved, sum, angle, largest, s) {
  for (name in common) {
    sum = 0
    for (i = 1; i <= 3; ++i)
      for (j = 1; j <= 3; ++j) {
        moved = 0
        for (k = 1; k <= 3; ++k) moved += model_rotation[name, i, k] * Q[j, k]
        sum += (moved - true_rotation[name, i, j]) ^ 2
      }
    s = sqrt(sum / 8)
    angle = 2 * atan2(s, sqrt(s < 1 ? 1 - s * s : 0)) * 45 / atan2(1, 1)
    if (angle > largest) largest = angle
  }
  return largest
}

FNR == 1 { ++file }
/^#/ { next }

file == 1 && $1 == "CAMERA" { true_focal = $5; next }
file == 1 {
  store(true_rotation, true_centre, $1, $2, $3, $4, $5, $6, $7, $8)
  known[$1] = 1
  ++num_true
}
file == 2 { model_focal = $5 }
# Every image has two lines; the second lists its 2D points and may be empty.
file == 3 && ++line % 2 == 1 && ($10 in known) {
  store(model_rotation, model_centre, $10, $2, $3, $4, $5, $6, $7, $8)
  common[$10] = 1
  ++num_common
}

END {
  if (num_common < 4) {
    print "check: fewer than 4 images have a ground truth" > "/dev/stderr"
    exit 1
  }
  true_spread = centre_and_spread(true_centre)
  scale = true_spread / centre_and_spread(model_centre)
  horn(Q)
  rms = centre_rms(Q, scale) / true_spread
  angle = largest_angle(Q)
  focal_error = abs(model_focal / true_focal - 1)
  printf "images with a ground truth    %d of %d\n", num_common, num_true
  printf "centres, RMS / scene size     %.2e  (limit 1e-3)\n", rms
  printf "rotations, largest angle      %.4f deg  (limit 0.1)\n", angle
  printf "focal length, relative error  %.2e  (limit 5e-3)\n", focal_error
  printf "scene size                    %.4f m, scale %.6f\n", \
    true_spread, scale
  exit !(num_common == num_true && rms < 1e-3 && angle < 0.1 && \
         focal_error < 5e-3)
}
