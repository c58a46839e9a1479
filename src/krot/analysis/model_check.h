#pragma once

#include "krot/check.h"
