#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <sstream>

#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/temporary_folder.h"
#include "core/rendering/simple_surfaces.h"
#include "us_ct_registration/rendering/surface_files.h"

namespace usct::test {
namespace {

template <typename T>
T take(std::istream& in) {
  T value{};
  in.read(reinterpret_cast<char*>(&value), sizeof(value));
  return value;
}

struct ReadMesh {
  std::vector<std::string> header;
  /// Corners of each triangle, mm.
  std::vector<std::array<Eigen::Vector3d, 3>> triangles;
  /// Red, green and blue of each point; empty without colours.
  std::vector<std::array<int, 3>> colours;

  bool has(const std::string& line) const {
    return std::find(header.begin(), header.end(), line) != header.end();
  }
};

Eigen::Vector3d take_point(std::istream& in) {
  const auto x = take<float>(in);
  const auto y = take<float>(in);
  const auto z = take<float>(in);
  return {x, y, z};
}

/// As the specification of binary, little-endian PLY says, with the properties of `header` in
/// order.
ReadMesh read_ply(const std::filesystem::path& path) {
  std::istringstream in(read_text(path));
  ReadMesh mesh;
  std::size_t points = 0;
  std::size_t faces = 0;
  for (std::string line; std::getline(in, line) && line != "end_header";) {
    mesh.header.push_back(line);
    if (line.rfind("element vertex ", 0) == 0) points = std::stoul(line.substr(15));
    if (line.rfind("element face ", 0) == 0) faces = std::stoul(line.substr(13));
  }
  std::vector<Eigen::Vector3d> points_mm;
  for (std::size_t i = 0; i < points; ++i) {
    points_mm.push_back(take_point(in));
    if (!mesh.has("property uchar red")) continue;
    const int red = take<std::uint8_t>(in);
    const int green = take<std::uint8_t>(in);
    mesh.colours.push_back({red, green, take<std::uint8_t>(in)});
  }
  for (std::size_t i = 0; i < faces; ++i) {
    EXPECT_EQ(take<std::uint8_t>(in), 3);
    auto& triangle = mesh.triangles.emplace_back();
    for (Eigen::Vector3d& corner : triangle)
      corner = points_mm.at(static_cast<std::size_t>(take<std::int32_t>(in)));
  }
  EXPECT_TRUE(in) << "the file is too short";
  EXPECT_EQ(in.peek(), std::char_traits<char>::eof());
  return mesh;
}

/// 80 bytes of header, the number of triangles, and for each its normal, corners and two bytes.
ReadMesh read_stl(const std::filesystem::path& path) {
  std::istringstream in(read_text(path));
  ReadMesh mesh;
  std::string header(80, '\0');
  in.read(header.data(), 80);
  mesh.header.push_back(header.c_str());
  const auto count = take<std::uint32_t>(in);
  for (std::uint32_t i = 0; i < count; ++i) {
    const Eigen::Vector3d normal = take_point(in);
    auto& [a, b, c] = mesh.triangles.emplace_back();
    for (Eigen::Vector3d* corner : {&a, &b, &c}) *corner = take_point(in);
    take<std::uint16_t>(in);
    const Eigen::Vector3d across = (b - a).cross(c - a);
    EXPECT_TRUE(across.norm() < 1e-6 || normal.dot(across.normalized()) > 0.99);
  }
  EXPECT_TRUE(in) << "the file is too short";
  EXPECT_EQ(in.peek(), std::char_traits<char>::eof());
  return mesh;
}

const Surface kEllipsoid = ellipsoid({-120.5, 80.25, 900.75}, {30.0, 20.0, 10.0}, 12);

void expect_same_triangles(const ReadMesh& read, const Surface& written) {
  ASSERT_EQ(read.triangles.size(), written.triangles.size());
  for (std::size_t i = 0; i < read.triangles.size(); ++i)
    for (std::size_t corner = 0; corner < 3; ++corner)
      EXPECT_LT(
          (read.triangles[i][corner] - written.points_mm[written.triangles[i][corner]]).norm(),
          2e-4)
          << "triangle " << i;
}

TEST(SurfaceFiles, APlyFileHasTheTrianglesTheColourAndTheFrame) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "kidney.ply";
  write_surface(kEllipsoid, "1 kidney\nend_header", {{1.0F, 0.5F, 0.0F}}, path);
  const ReadMesh mesh = read_ply(path);
  expect_same_triangles(mesh, kEllipsoid);
  EXPECT_EQ(mesh.header.at(0), "ply");
  EXPECT_TRUE(mesh.has("format binary_little_endian 1.0"));
  EXPECT_TRUE(mesh.has("comment SPACE=LPS"));
  EXPECT_TRUE(mesh.has("comment unit mm"));
  EXPECT_TRUE(mesh.has("comment name 1 kidney end_header"));
  ASSERT_EQ(mesh.colours.size(), kEllipsoid.points_mm.size());
  for (const auto& colour : mesh.colours) EXPECT_EQ(colour, (std::array<int, 3>{255, 128, 0}));
}

TEST(SurfaceFiles, WithoutAColourAPlyFileHasNone) {
  const TemporaryFolder folder;
  write_surface(kEllipsoid, "CT", std::nullopt, folder.path() / "ct.ply");
  const ReadMesh mesh = read_ply(folder.path() / "ct.ply");
  expect_same_triangles(mesh, kEllipsoid);
  EXPECT_TRUE(mesh.colours.empty());
}

TEST(SurfaceFiles, AnStlFileHasTheTrianglesWithTheirNormalsAndTheFrame) {
  const TemporaryFolder folder;
  write_surface(kEllipsoid, std::string(200, 'x'), {{1.0F, 0.5F, 0.0F}}, folder.path() / "a.stl");
  const ReadMesh mesh = read_stl(folder.path() / "a.stl");
  expect_same_triangles(mesh, kEllipsoid);
  EXPECT_EQ(mesh.header[0].rfind("SPACE=LPS unit=mm xxx", 0), 0U) << mesh.header[0];
}

TEST(SurfaceFiles, WhatCannotBeWrittenIsRefusedAndLeavesNothing) {
  const TemporaryFolder folder;
  const auto write = [&](const Surface& surface, const std::string& name) {
    return [=, &folder] { write_surface(surface, "x", std::nullopt, folder.path() / name); };
  };
  expect_input_error(write(kEllipsoid, "a.obj"), {"a.obj", "'.obj'", ".ply or .stl"});
  expect_input_error(write(kEllipsoid, "a"), {"''", ".ply or .stl"});
  expect_input_error(write(Surface{}, "a.ply"), {"a.ply", "no triangles"});
  for (const char* name : {"absent/a.ply", "absent/a.stl"})
    expect_input_error(write(kEllipsoid, name), {name});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace usct::test
