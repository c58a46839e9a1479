"""solve_folder.py INPUT_FOLDER OUTPUT_FOLDER: what `krot solver` does."""

import sys

import pykrot

result = pykrot.solve(pykrot.Model.read(sys.argv[1]))
result.model.write(sys.argv[2])
print(result.max_error, "px, none below", result.lower_bound)
