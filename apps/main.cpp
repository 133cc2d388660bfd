#include <cstdio>

int main() {
  std::printf("feltmap %s\n", FELTMAP_VERSION);
  return 0;
}
