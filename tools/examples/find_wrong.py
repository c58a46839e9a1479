"""find_wrong.py INPUT_FOLDER OUTPUT_FOLDER: which images and observations of a
model contradict the others, and the model without them.
"""

import sys

import pykrot

result = pykrot.check(pykrot.Model.read(sys.argv[1]))
print(result.report["verdict"])
for image in result.report["images"]:
    if image["verdict"] == "wrong":
        print(f"{image['image_name']} is wrong: {image['num_wrong']} of "
              f"{image['num_tested']} observations contradict others")
result.model.write(sys.argv[2])
