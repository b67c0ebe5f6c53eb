#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <future>
#include <nlohmann/json.hpp>
#include <regex>

#include "core/io/bad_files.h"
#include "core/io/file_size_limit.h"
#include "core/io/itk_oracle.h"
#include "us_ct_registration/io/results/transform_io.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::spit;
using test::TemporaryFolder;

TEST(TransformIo, AFileWithoutParametersIsNotTheIdentity) {
  // ITK itself reads the file as the same transform.
  const TemporaryFolder folder;
  const std::string header =
      "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n";
  for (const char* rest : {"", "Parameters: 1 0 0 0 1 0 0 0 1 10 20 3"})
    expect_input_error([&] { read_T_us_ct(spit(folder.path() / "t.tfm", header + rest)); },
                       {"t.tfm", "FixedParameters"});
}

const char* const kExtensions[] = {".tfm", ".txt", ".h5", ".hdf5"};

/// The text of a file with one transform, as Slicer and ITK write it.
std::string tfm(const std::string& type, const std::string& parameters, const std::string& fixed) {
  return "#Insight Transform File V1.0\n#Transform 0\nTransform: " + type +
         "\nParameters: " + parameters + "\nFixedParameters: " + fixed + "\n";
}

Eigen::Isometry3d read_transform_from(const std::string& content) {
  const TemporaryFolder folder;
  return read_T_us_ct(spit(folder.path() / "t.tfm", content));
}

double distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

RC_GTEST_PROP(TransformIo, WhatIsWrittenComesBack, ()) {
  const auto number = [] { return *rc::gen::inRange(-1000000, 1000000) * 3.1e-4; };
  const Eigen::Vector3d axis(number(), number(), number() + 1e-9);
  const Eigen::Isometry3d T =
      Eigen::Translation3d(number(), number(), number()) *
      Eigen::AngleAxisd(*rc::gen::inRange(-3141, 3142) * 1e-3, axis.normalized());
  const TemporaryFolder folder;
  for (const char* extension : kExtensions) {
    const std::filesystem::path path = folder.path() / (std::string("t") + extension);
    write_T_us_ct(T, path);
    RC_ASSERT(distance(read_T_us_ct(path), T) < 1e-12);
  }
}

TEST(TransformIo, TheFileMapsUltrasoundToCt) {
  // Fixed = US, moving = CT: a CT that must move by +10 mm in x to reach the US frame has -10 in
  // the file. Swapping the two is the classic mistake.
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "t.tfm";
  write_T_us_ct(Eigen::Isometry3d(Eigen::Translation3d(10, 0, 0)), path);
  const test::FileBytes bytes = test::slurp(path);
  const std::string text(bytes.begin(), bytes.end());
  EXPECT_NE(text.find("Parameters: 1 0 0 0 1 0 0 0 1 -10 0 0"), std::string::npos) << text;
  EXPECT_NE(text.find("AffineTransform_double_3_3"), std::string::npos) << text;
  EXPECT_EQ(
      read_transform_from(tfm("AffineTransform_double_3_3", "1 0 0 0 1 0 0 0 1 -10 0 0", "0 0 0"))
          .translation(),
      Eigen::Vector3d(10, 0, 0));
}

TEST(TransformIo, EveryLinearTransformThatIsARotation) {
  // A quarter turn about z, (x, y) -> (-y, x), about the centre c = (1, 2, 3), then t = (10, 20,
  // 30).
  const Eigen::Vector3d c(1, 2, 3);
  const Eigen::Vector3d t(10, 20, 30);
  Eigen::Matrix3d R;
  R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Eigen::Isometry3d expected = Eigen::Isometry3d::Identity();
  expected.linear() = R;
  expected.translation() = c + t - R * c;
  expected = expected.inverse();  // the file holds T_ct_us
  const std::string half_pi = "1.5707963267948966";
  const std::string half_root = "0.70710678118654757";  // sin 45 degrees
  const auto expect_same = [&](const std::string& type, const std::string& parameters,
                               const std::string& fixed) {
    EXPECT_LT(distance(read_transform_from(tfm(type, parameters, fixed)), expected), 1e-9) << type;
  };
  expect_same("Euler3DTransform_double_3_3", "0 0 " + half_pi + " 10 20 30", "1 2 3 0");
  expect_same("Euler3DTransform_double_3_3", "0 0 " + half_pi + " 10 20 30", "1 2 3 1");  // ZYX
  expect_same("VersorRigid3DTransform_double_3_3", "0 0 " + half_root + " 10 20 30", "1 2 3");
  expect_same("Similarity3DTransform_double_3_3", "0 0 " + half_root + " 10 20 30 1", "1 2 3");
  expect_same("QuaternionRigidTransform_double_3_3",
              "0 0 " + half_root + " " + half_root + " 10 20 30", "1 2 3");
  expect_same("AffineTransform_double_3_3", "0 -1 0 1 0 0 0 0 1 10 20 30", "1 2 3");
  expect_same("MatrixOffsetTransformBase_double_3_3", "0 -1 0 1 0 0 0 0 1 10 20 30", "1 2 3");
  EXPECT_EQ(read_transform_from(tfm("IdentityTransform_double_3_3", "", "")).matrix(),
            Eigen::Matrix4d::Identity());
  EXPECT_EQ(read_transform_from(tfm("TranslationTransform_double_3_3", "1 2 3", "")).translation(),
            Eigen::Vector3d(-1, -2, -3));
}

/// ITK's own reader takes missing numbers from beyond the end of those that are there, reads a
/// fixed one up to what is no digit, and leaves surplus ones out.
TEST(TransformIo, ParametersMustBeJustAsManyNumbers) {
  const auto refuse = [](const std::string& parameters, const std::string& fixed,
                         const std::string& field) {
    for (const std::string precision : {"double", "float"}) {
      SCOPED_TRACE(precision + ": " + parameters + " / " + fixed);
      expect_input_error(
          [&] {
            read_transform_from(tfm("Euler3DTransform_" + precision + "_3_3", parameters, fixed));
          },
          {"t.tfm", "'" + field + "'"});
    }
  };
  const std::string good = "0.1 0.2 0.3 4 -1 2";
  EXPECT_NO_THROW(read_transform_from(tfm("Euler3DTransform_float_3_3", good, "10 20 30")));
  for (const char* parameters :
       {"-inf 0.1 0.3 4 -1 2", "- 0.1 0.3 4 -1 2", "0.1 0.3 4 -1 2", "0.1 0.2 0.3 4 -1 2 9", ""})
    refuse(parameters, "10 20 30", "Parameters");
  for (const char* fixed : {"10 20 3O", "10 20 30,5", "10 20", "10 20 nan", "10 20 30 0 0", ""})
    refuse(good, fixed, "FixedParameters");
  expect_input_error(
      [&] {
        read_transform_from(tfm("Euler3DTransform_double_3_3", good, "1 2 3") +
                            "FixedParameters: 1 2 4\n");
      },
      {"t.tfm", "'FixedParameters'", "twice"});
}

TEST(TransformIo, ParametersInHdf5MustBeJustAsManyNumbersToo) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "t.h5";
  const std::string euler = "Euler3DTransform_double_3_3";
  const std::vector<double> good = {0.1, 0.2, 0.3, 1, 2, 3};
  const auto read = [&](const test::ItkTransform& transform, bool with_fixed_parameters = true) {
    test::write_hdf5_transform(transform, with_fixed_parameters, path);
    return read_T_us_ct(path);
  };
  EXPECT_NO_THROW(read({euler, good, {0, 0, 0}}));
  EXPECT_NO_THROW(read({"Euler3DTransform_float_3_3", good, {0, 0, 0, 1}}));
  for (const std::vector<double>& parameters : {std::vector<double>{},
                                                {0.1, 0.2, 0.3},
                                                {0.1, 0.2, 0.3, 1, 2},
                                                {0.1, 0.2, 0.3, 1, 2, 3, 9},
                                                {0.1, NAN, 0.3, 1, 2, 3},
                                                std::vector<double>(100000)})
    expect_input_error([&] { read({euler, parameters, {0, 0, 0}}); }, {"t.h5", "Parameters'"});
  for (const std::vector<double>& fixed : {std::vector<double>{5}, {0, 0, NAN}, {0, 0, 0, 0, 0}})
    expect_input_error([&] { read({euler, good, fixed}); }, {"t.h5", "'FixedParameters'"});
  expect_input_error([&] { read({euler, good, {}}, false); }, {"t.h5", "'FixedParameters'"});
  expect_input_error(
      [&] {
        read({"VersorTransform_double_3_3", {0.1}, {0, 0, 0}});
      },
      {"t.h5", "'Parameters'", "must be 3"});
  expect_input_error(
      [&] {
        read({"VersorRigid3DTransform_double_3_3", {1.5, 0, 0, 0, 0, 0}, {0, 0, 0}});
      },
      {"t.h5", "longer than 1"});
  expect_input_error(
      [&] {
        read({"BSplineTransform_double_3_3", good, {}});
      },
      {"t.h5", "BSplineTransform", "linear"});
}

TEST(TransformIo, WhatItkWritesAndReadsIsTheSame) {
  const TemporaryFolder folder;
  const test::ItkTransform euler{
      "Euler3DTransform_double_3_3", {0.1, 0.2, 0.3, 1, 2, 3}, {4, 5, 6, 1}};
  const test::ItkTransform versor{
      "VersorRigid3DTransform_double_3_3", {0.1, 0.2, 0.3, 1, 2, 3}, {4, 5, 6}};
  const test::ItkTransform shift{"TranslationTransform_double_3_3", {1, 2, 3}, {}};
  const test::ItkTransform nothing{"IdentityTransform_double_3_3", {}, {}};
  const test::ItkTransform centred{
      "CenteredEuler3DTransform_double_3_3", {0.1, 0.2, 0.3, 4, 5, 6, 1, 2, 3}, {4, 5, 6}};
  const std::array<double, 3> point = {100, -50, 20};
  const auto expect_as_itk = [&](const std::filesystem::path& path) {
    const std::array<double, 3> moved = test::moved_by_itk(path, point);
    const Eigen::Vector3d ours =
        read_T_us_ct(path).inverse() * Eigen::Vector3d(point[0], point[1], point[2]);
    EXPECT_LT((ours - Eigen::Vector3d(moved[0], moved[1], moved[2])).norm(), 1e-9) << path;
  };
  for (const char* extension : {".tfm", ".h5"}) {
    const std::filesystem::path path = folder.path() / (std::string("t") + extension);
    for (const std::vector<test::ItkTransform>& parts : {std::vector<test::ItkTransform>{euler},
                                                         {versor},
                                                         {shift},
                                                         {nothing},
                                                         {centred},
                                                         {euler, shift, versor}}) {
      SCOPED_TRACE(parts.front().type);
      test::write_by_itk(parts, path);
      expect_as_itk(path);
    }
    write_T_us_ct(Eigen::Translation3d(10, 20, 30) *
                      Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()),
                  path);
    expect_as_itk(path);
  }
}

TEST(TransformIo, AFullDiskLeavesTheOldFile) {
  const TemporaryFolder folder;
  for (const char* extension : kExtensions) {
    SCOPED_TRACE(extension);
    const std::filesystem::path path = folder.path() / (std::string("t") + extension);
    const Eigen::Isometry3d old(Eigen::Translation3d(10, 20, 30));
    write_T_us_ct(old, path);
    try {
      const test::FileSizeLimit full(16);
      write_T_us_ct(Eigen::Isometry3d::Identity(), path);
      ADD_FAILURE() << "no error was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(error.what(), path.string() + ": writing failed: File too large");
    }
    EXPECT_EQ(distance(read_T_us_ct(path), old), 0.0);
    std::filesystem::remove(path);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  }
}

/// ITK's own reader of this type leaves the centre out.
TEST(TransformIo, AVersorTurnsAboutItsCentre) {
  const Eigen::Vector3d c(1, 2, 3);
  Eigen::Isometry3d expected = Eigen::Isometry3d::Identity();
  expected.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  expected.translation() = c - expected.linear() * c;
  const std::string versor = tfm("VersorTransform_double_3_3", "0 0 0.70710678118654757", "1 2 3");
  EXPECT_LT(distance(read_transform_from(versor).inverse(), expected), 1e-9);
  const std::string composite =
      "#Insight Transform File V1.0\n#Transform 0\nTransform: CompositeTransform_double_3_3\n"
      "#Transform 1\nTransform: VersorTransform_double_3_3\n"
      "Parameters: 0 0 0.70710678118654757\nFixedParameters: 1 2 3\n";
  EXPECT_LT(distance(read_transform_from(composite).inverse(), expected), 1e-9);
}

/// As of a decimal point that has slipped; ITK would cut it down to half a turn.
TEST(TransformIo, AVersorLongerThanOneIsRefused) {
  const std::string rigid = "0 0 2.474 1 2 3";
  const auto refuse = [](const std::string& content) {
    expect_input_error([&] { read_transform_from(content); }, {"t.tfm", "longer than 1"});
  };
  refuse(tfm("VersorRigid3DTransform_double_3_3", rigid, "0 0 0"));
  refuse(tfm("VersorRigid3DTransform_float_3_3", rigid, "0 0 0"));
  refuse(tfm("Similarity3DTransform_double_3_3", rigid + " 1", "0 0 0"));
}

TEST(TransformIo, EulerAnglesInItksOrder) {
  // ITK documents ZXY: R = Rz Rx Ry; with ComputeZYX R = Rz Ry Rx.
  const double x = 0.3, y = -0.4, z = 0.5;
  const auto turn = [](double angle, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  };
  const Eigen::Matrix3d Rx = turn(x, Eigen::Vector3d::UnitX());
  const Eigen::Matrix3d Ry = turn(y, Eigen::Vector3d::UnitY());
  const Eigen::Matrix3d Rz = turn(z, Eigen::Vector3d::UnitZ());
  const std::string parameters = "0.3 -0.4 0.5 0 0 0";
  const auto rotation = [&](const std::string& fixed) -> Eigen::Matrix3d {
    return read_transform_from(tfm("Euler3DTransform_double_3_3", parameters, fixed))
        .inverse()
        .linear();
  };
  EXPECT_LT((rotation("0 0 0 0") - Rz * Rx * Ry).norm(), 1e-12);
  EXPECT_LT((rotation("0 0 0 1") - Rz * Ry * Rx).norm(), 1e-12);
  EXPECT_LT((rotation("0 0 0") - Rz * Rx * Ry).norm(), 1e-12);  // older files
}

TEST(TransformIo, SinglePrecisionAndCompositesAsRegistrationProgramsWriteThem) {
  EXPECT_LT(
      (read_transform_from(tfm("AffineTransform_float_3_3", "0 -1 0 1 0 0 0 0 1 10 20 30", "0 0 0"))
           .inverse()
           .translation() -
       Eigen::Vector3d(10, 20, 30))
          .norm(),
      1e-6);
  // A composite applies its last transform first.
  const std::string composite =
      "#Insight Transform File V1.0\n#Transform 0\nTransform: CompositeTransform_double_3_3\n"
      "#Transform 1\nTransform: AffineTransform_double_3_3\n"
      "Parameters: 0 -1 0 1 0 0 0 0 1 0 0 0\nFixedParameters: 0 0 0\n"
      "#Transform 2\nTransform: TranslationTransform_double_3_3\nParameters: 1 0 "
      "0\nFixedParameters: \n";
  const Eigen::Isometry3d T_ct_us = read_transform_from(composite).inverse();
  EXPECT_LT((T_ct_us * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 2, 0)).norm(), 1e-12);
}

TEST(TransformIo, RefusesWhatIsNotARotationAndSaysByHowMuch) {
  const auto refuse = [](const std::string& content, std::initializer_list<std::string> fragments) {
    SCOPED_TRACE(content);
    expect_input_error([&] { read_transform_from(content); }, fragments);
  };
  const std::string affine = "AffineTransform_double_3_3";
  refuse(tfm(affine, "2 0 0 0 1 0 0 0 1 0 0 0", "0 0 0"),
         {"t.tfm", affine, "determinant 2", "deviation"});
  refuse(tfm(affine, "-1 0 0 0 1 0 0 0 1 0 0 0", "0 0 0"), {"determinant -1"});
  refuse(tfm(affine, "1 0.001 0 0 1 0 0 0 1 0 0 0", "0 0 0"), {"deviation", "0.001"});
  refuse(tfm(affine, "0 0 0 0 0 0 0 0 0 0 0 0", "0 0 0"), {"determinant 0"});
  refuse(tfm(affine, "nan 0 0 0 1 0 0 0 1 0 0 0", "0 0 0"), {"t.tfm"});
  refuse(tfm(affine, "1 0 0 0 1 0 0 0 1 nan 0 0", "0 0 0"), {"t.tfm"});
  refuse(tfm("Similarity3DTransform_double_3_3", "0 0 0 0 0 0 1.1", "0 0 0"), {"determinant 1.33"});
  refuse(tfm("Euler2DTransform_double_2_2", "0 0 0", "0 0"), {"t.tfm", "Euler2DTransform", "3"});
  refuse(tfm(affine, "1 0 0", "0 0 0"), {"t.tfm"});
  refuse(tfm("NoSuchTransform_double_3_3", "1 0 0", "0 0 0"), {"t.tfm", "NoSuchTransform"});
  refuse(tfm(affine, "1 0 0 0 1 0 0 0 1 0 0 0", "0 0 0") + "#Transform 1\nTransform: " + affine +
             "\nParameters: 1 0 0 0 1 0 0 0 1 0 0 0\nFixedParameters: 0 0 0\n",
         {"t.tfm", "2 transforms"});
  refuse("#Insight Transform File V1.0\n", {"t.tfm"});
  // A deformation: 2 control points per axis and cubic splines.
  std::string zeros;
  for (int i = 0; i < 3 * 5 * 5 * 5; ++i) zeros += "0 ";
  refuse(tfm("BSplineTransform_double_3_3", zeros, "5 5 5 0 0 0 1 1 1 1 0 0 0 1 0 0 0 1"),
         {"t.tfm", "BSplineTransform", "linear"});
}

TEST(TransformIo, RefusesBrokenFiles) {
  const TemporaryFolder folder;
  for (const std::string extension : {".tfm", ".h5"}) {
    SCOPED_TRACE(extension);
    const std::filesystem::path path = folder.path() / ("good" + extension);
    write_T_us_ct(Eigen::Isometry3d(Eigen::Translation3d(10, 20, 30)), path);
    test::expect_refuses_broken_files([](const auto& p) { read_T_us_ct(p); }, test::slurp(path),
                                      extension);
  }
  expect_input_error([&] { read_T_us_ct(folder.path() / "t.mat"); }, {"t.mat", ".mat", ".tfm"});
  expect_input_error([&] { write_T_us_ct(Eigen::Isometry3d::Identity(), folder.path() / "t"); },
                     {".tfm"});
}

TEST(TransformIo, ALostNameInHdf5IsDamage) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "t.h5";
  write_T_us_ct(Eigen::Isometry3d::Identity(), path);
  test::FileBytes bytes = test::slurp(path);
  // Texts of any length are kept as their length and the address of the heap that holds them.
  const std::string heap = "GCOL";
  const auto address = std::search(bytes.begin(), bytes.end(), heap.begin(), heap.end());
  ASSERT_NE(address, bytes.end());
  test::FileBytes reference;
  test::append_int32(reference, static_cast<int>(std::string("AffineTransform_double_3_3").size()));
  test::append_int32(reference, static_cast<int>(address - bytes.begin()));
  const auto name = std::search(bytes.begin(), bytes.end(), reference.begin(), reference.end());
  ASSERT_NE(name, bytes.end());
  std::fill(name, name + 8, 0);
  expect_input_error([&] { read_T_us_ct(spit(path, bytes)); }, {"t.h5", "transform 0", "no text"});
}

TEST(TransformIo, WhatIsNotRigidIsNotWritten) {
  const TemporaryFolder folder;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() *= 1.01;
  expect_input_error([&] { write_T_us_ct(T, folder.path() / "t.tfm"); },
                     {"t.tfm", "T_us_ct", "determinant"});
  T = Eigen::Isometry3d::Identity();
  T.translation().x() = std::nan("");
  expect_input_error([&] { write_T_us_ct(T, folder.path() / "t.tfm"); }, {"T_us_ct", "finite"});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(TransformIo, ManyThreadsAtOnce) {
  const TemporaryFolder folder;
  std::vector<std::future<double>> tasks;
  for (int i = 0; i < 8; ++i)
    tasks.push_back(std::async(std::launch::async, [&folder, i] {
      const std::filesystem::path path =
          folder.path() / (std::to_string(i) + (i % 2 == 0 ? ".tfm" : ".h5"));
      const Eigen::Isometry3d T(Eigen::Translation3d(i, 0, 0));
      double worst = 0.0;
      for (int repeat = 0; repeat < 20; ++repeat) {
        write_T_us_ct(T, path);
        worst = std::max(worst, distance(read_T_us_ct(path), T));
      }
      return worst;
    }));
  for (auto& task : tasks) EXPECT_LT(task.get(), 1e-12);
}

/// `usct info` prints what rosservice takes: metres, the quaternion with its real part last.
TEST(TransformIo, IsDescribedAsARequestOfTheRosInterface) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "start.tfm";
  Eigen::Isometry3d T_us_ct(Eigen::AngleAxisd(2.5, Eigen::Vector3d(0.3, -2.1, 1.4).normalized()));
  T_us_ct.translation() = Eigen::Vector3d(258.5, 97.25, -76.125);
  write_T_us_ct(T_us_ct, path);
  const std::string request =
      nlohmann::json::parse(describe_transform(path)).at("set_initial_alignment");
  EXPECT_EQ(request.find("{type: 1, header: {frame_id: us}, transform: {translation: {x: "), 0U);
  static const std::regex kNumber("[xyzw]: ([^,}]+)");
  std::vector<double> numbers;
  for (std::sregex_iterator at(request.begin(), request.end(), kNumber), end; at != end; ++at)
    numbers.push_back(std::stod((*at)[1]));
  ASSERT_EQ(numbers.size(), 7U);
  const Eigen::Vector3d t_mm = 1000.0 * Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  const Eigen::Quaterniond q(numbers[6], numbers[3], numbers[4], numbers[5]);
  EXPECT_LT((t_mm - T_us_ct.translation()).norm(), 1e-4);
  EXPECT_LT((q.toRotationMatrix() - T_us_ct.linear()).norm(), 1e-9);
}

}  // namespace
}  // namespace usct
