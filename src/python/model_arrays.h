#pragma once

#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include <pybind11/numpy.h>

#include "krot/model.h"

namespace krot::internal {

template <typename T>
using CArray =
    pybind11::array_t<T, pybind11::array::c_style | pybind11::array::forcecast>;

// A camera as Python gives it: model's name, width, height, parameters.
using CameraTuple =
    std::tuple<std::string, uint64_t, uint64_t, std::vector<double>>;

// Makes a model from observations in numpy arrays, with one frame per image;
// ids are indices plus one. `rotations` (images, 3, 3) and `translations`
// (images, 3) are camera from world; translations are NaN where they are
// unknown, rotations must be known. O(observations), which are copied once.
// Throws ModelError, and std::invalid_argument for arrays that do not fit
// together.
std::shared_ptr<Model> ModelFromArrays(const CArray<double>& observations,
                                       const CArray<int64_t>& image_indices,
                                       const CArray<int64_t>& point_indices,
                                       const CArray<double>& rotations,
                                       const CArray<double>& translations,
                                       const CArray<double>& points,
                                       const std::vector<CameraTuple>& cameras,
                                       const CArray<int64_t>& camera_indices,
                                       const std::vector<std::string>& names);

}  // namespace krot::internal
