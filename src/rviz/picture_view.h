#pragma once

#include <QPixmap>
#include <QWidget>

namespace usct::ros_interface {

/// Shows a picture as large as fits, in its own proportions. A double click opens it in a window.
class PictureView : public QWidget {
 public:
  using QWidget::QWidget;

  void set_picture(const QPixmap& picture);
  const QPixmap& picture() const { return picture_; }

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mouseDoubleClickEvent(QMouseEvent* event) override;

 private:
  QPixmap picture_;
  /// The window with the same picture; null until it is opened.
  PictureView* window_ = nullptr;
};

}  // namespace usct::ros_interface
