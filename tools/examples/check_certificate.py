"""check_certificate.py MODEL_FOLDER CERTIFICATE: whether the file of
`krot solver --certificate_path` proves its bound for this model.
"""

import sys
from pathlib import Path

import pykrot

model = pykrot.Model.read(sys.argv[1])
verdict = pykrot.check_certificate(model, Path(sys.argv[2]).read_text())
if not verdict.is_accepted:
    sys.exit(f"rejected: {verdict.refusal}")
print(f"proved: no positions bring the largest error below "
      f"{verdict.lower_bound:.6f} px")
