#pragma once

#include "krot/minimax.h"
