// Reads a GLB file with tinygltf alone and prints what any viewer would find: for each primitive its mode and indices,
// and for each attribute its name, number of components, component type, count, least and greatest value.
// usage: stock_glb_reader FILE
#include <tiny_gltf.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <limits>
#include <string>

namespace {

double component(const unsigned char* at, int type) {
  if (type == TINYGLTF_COMPONENT_TYPE_FLOAT) {
    float value;
    std::memcpy(&value, at, sizeof value);
    return value;
  }
  if (type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT) {
    unsigned short value;
    std::memcpy(&value, at, sizeof value);
    return value;
  }
  unsigned value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

void print(const tinygltf::Model& model, const std::string& name, int number) {
  const tinygltf::Accessor& accessor = model.accessors.at(size_t(number));
  const tinygltf::BufferView& view = model.bufferViews.at(size_t(accessor.bufferView));
  const tinygltf::Buffer& buffer = model.buffers.at(size_t(view.buffer));
  const int components = tinygltf::GetNumComponentsInType(unsigned(accessor.type));
  const int size = tinygltf::GetComponentSizeInBytes(unsigned(accessor.componentType));
  const size_t stride = size_t(accessor.ByteStride(view));
  double least = std::numeric_limits<double>::infinity(), greatest = -least;
  for (size_t i = 0; i < accessor.count; ++i)
    for (int c = 0; c < components; ++c) {
      const double x = component(&buffer.data.at(view.byteOffset + accessor.byteOffset + i * stride + size_t(c * size)),
                                 accessor.componentType);
      least = std::min(least, x);
      greatest = std::max(greatest, x);
    }
  std::printf("%s %d %d %zu %g %g\n", name.c_str(), components, accessor.componentType, accessor.count, least,
              greatest);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  tinygltf::Model model;
  tinygltf::TinyGLTF loader;
  std::string error, warning;
  const bool loaded = loader.LoadBinaryFromFile(&model, &error, &warning, argv[1]);
  if (!loaded || !error.empty() || !warning.empty()) {
    std::fprintf(stderr, "%s%s\n", error.c_str(), warning.c_str());
    return 1;
  }
  for (const tinygltf::Mesh& mesh : model.meshes)
    for (const tinygltf::Primitive& primitive : mesh.primitives) {
      std::printf("mode %d\n", primitive.mode);
      if (primitive.indices >= 0) print(model, "indices", primitive.indices);
      for (const auto& [name, number] : primitive.attributes) print(model, name, number);
    }
  return 0;
}
