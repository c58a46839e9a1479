#include "tools/krot/photo.h"

#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <jpeglib.h>
#include <png.h>

#include "krot/context.h"
#include "krot/model/model_io.h"

namespace krot::internal {
namespace {

constexpr uint8_t kOutside = 128;
constexpr int kJpegQuality = 88;

// libjpeg reports errors by a call that must not return.
struct JpegErrors {
  jpeg_error_mgr manager;
  std::jmp_buf jump;
};

void LeaveJpeg(j_common_ptr info) {
  std::longjmp(reinterpret_cast<JpegErrors*>(info->err)->jump, 1);
}

void SayNothing(j_common_ptr) {}

// Between setjmp and longjmp nothing with a destructor is alive but `photo`,
// which belongs to the caller.
bool ReadJpeg(const std::string& bytes, Photo* photo) {
  jpeg_decompress_struct info;
  JpegErrors errors;
  info.err = jpeg_std_error(&errors.manager);
  errors.manager.error_exit = LeaveJpeg;
  errors.manager.output_message = SayNothing;
  if (setjmp(errors.jump) != 0) {
    jpeg_destroy_decompress(&info);
    return false;
  }
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(bytes.data()),
               static_cast<unsigned long>(bytes.size()));
  jpeg_read_header(&info, TRUE);
  info.out_color_space = JCS_RGB;
  jpeg_start_decompress(&info);
  photo->width = static_cast<int>(info.output_width);
  photo->height = static_cast<int>(info.output_height);
  photo->rgb.resize(size_t{3} * info.output_width * info.output_height);
  while (info.output_scanline < info.output_height) {
    JSAMPROW row = photo->rgb.data() +
                   size_t{3} * info.output_width * info.output_scanline;
    jpeg_read_scanlines(&info, &row, 1);
  }
  jpeg_finish_decompress(&info);
  jpeg_destroy_decompress(&info);
  return true;
}

bool ReadPng(const std::string& bytes, Photo* photo) {
  png_image image;
  std::memset(&image, 0, sizeof(image));
  image.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) ==
      0) {
    return false;
  }
  image.format = PNG_FORMAT_RGB;
  photo->width = static_cast<int>(image.width);
  photo->height = static_cast<int>(image.height);
  photo->rgb.resize(PNG_IMAGE_SIZE(image));
  const png_color behind = {255, 255, 255};
  const bool is_read = png_image_finish_read(&image, &behind, photo->rgb.data(),
                                             0, nullptr) != 0;
  png_image_free(&image);
  return is_read;
}

}  // namespace

std::optional<Photo> ReadPhoto(const std::string& path) {
  std::string bytes;
  try {
    bytes = ReadFileBytes(path).bytes;
  } catch (const ModelError&) {
    return std::nullopt;
  }
  constexpr size_t kHead = 8;
  const bool is_png =
      bytes.size() >= kHead &&
      png_sig_cmp(reinterpret_cast<const unsigned char*>(bytes.data()), 0,
                  kHead) == 0;
  Photo photo;
  if (is_png ? ReadPng(bytes, &photo) : ReadJpeg(bytes, &photo)) return photo;
  return std::nullopt;
}

Photo CropPhoto(const Photo& photo, int left, int top, int size) {
  Photo crop{size, size,
             std::vector<uint8_t>(size_t{3} * size * size, kOutside)};
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const int64_t from_x = int64_t{left} + x;
      const int64_t from_y = int64_t{top} + y;
      if (from_x < 0 || from_x >= photo.width || from_y < 0 ||
          from_y >= photo.height) {
        continue;
      }
      std::memcpy(&crop.rgb[3 * (size_t{1} * y * size + x)],
                  &photo.rgb[3 * (from_y * photo.width + from_x)], 3);
    }
  }
  return crop;
}

Photo ShrinkPhoto(const Photo& photo, int width, int height) {
  Photo small{width, height, std::vector<uint8_t>(size_t{3} * width * height)};
  const auto first = [](int n, int of, int whole) {
    return static_cast<int>(int64_t{n} * whole / of);
  };
  for (int y = 0; y < height; ++y) {
    const int top = first(y, height, photo.height);
    const int bottom = first(y + 1, height, photo.height);
    for (int x = 0; x < width; ++x) {
      const int left = first(x, width, photo.width);
      const int right = first(x + 1, width, photo.width);
      for (int c = 0; c < 3; ++c) {
        int64_t sum = 0;
        for (int v = top; v < bottom; ++v) {
          for (int u = left; u < right; ++u) {
            sum += photo.rgb[3 * (size_t{1} * v * photo.width + u) + c];
          }
        }
        small.rgb[3 * (size_t{1} * y * width + x) + c] = static_cast<uint8_t>(
            sum / std::max<int64_t>(1, int64_t{bottom - top} * (right - left)));
      }
    }
  }
  return small;
}

std::vector<uint8_t> EncodeJpeg(const Photo& photo) {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &buffer, &size);
  info.image_width = static_cast<JDIMENSION>(photo.width);
  info.image_height = static_cast<JDIMENSION>(photo.height);
  info.input_components = 3;
  info.in_color_space = JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, kJpegQuality, TRUE);
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<uint8_t*>(
        &photo.rgb[size_t{3} * info.image_width * info.next_scanline]);
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  const std::vector<uint8_t> bytes(buffer, buffer + size);
  std::free(buffer);
  return bytes;
}

}  // namespace krot::internal
