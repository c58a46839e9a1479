#pragma once

#include "krot/model.h"
