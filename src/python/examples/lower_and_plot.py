"""Lowers the largest error of a COLMAP model, removes what stands in the way of
a bound, and draws the errors' distribution before, after and without.

python3 lower_and_plot.py sparse/0 1.5 errors.png
"""

import sys

import matplotlib
import numpy as np

import pykrot

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402


def main(model_path, max_error, plot_path):
    model = pykrot.Model.read(model_path)
    lowest = pykrot.solve(model)
    print(f"largest error {lowest.max_error:.3f} px, "
          f"none below {lowest.lower_bound:.3f} px")
    kept = pykrot.filter(model, max_error)
    print(f"{kept.report['num_removed']} observations removed, of which "
          f"{kept.report['num_must_go']} had to go, for {max_error} px")

    for label, of in (("input", model), ("lowest maximum", lowest.model),
                      ("without outliers", kept.model)):
        errors = np.sort(of.pixel_errors())
        share = 1 - np.arange(errors.size) / errors.size
        pyplot.semilogy(errors, share, label=label)
    pyplot.xlabel("error, pixels")
    pyplot.ylabel("share of observations above")
    pyplot.legend()
    pyplot.savefig(plot_path, dpi=120)


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), sys.argv[3])
