#pragma once

#include "krot/transform.h"
