#pragma once

#include "krot/context.h"
