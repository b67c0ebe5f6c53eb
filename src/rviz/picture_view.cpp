#include "rviz/picture_view.h"

#include <QPainter>

namespace usct::ros_interface {

void PictureView::set_picture(const QPixmap& picture) {
  picture_ = picture;
  update();
  if (window_ != nullptr) window_->set_picture(picture);
}

void PictureView::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), Qt::black);
  if (picture_.isNull()) {
    painter.setPen(Qt::lightGray);
    painter.drawText(rect(), Qt::AlignCenter | Qt::TextWordWrap,
                     tr("no picture of fusion_view has arrived"));
    return;
  }
  painter.setRenderHint(QPainter::SmoothPixmapTransform);
  const QSize size = picture_.size().scaled(rect().size(), Qt::KeepAspectRatio);
  const QPoint corner((width() - size.width()) / 2, (height() - size.height()) / 2);
  painter.drawPixmap(QRect(corner, size), picture_);
}

void PictureView::mouseDoubleClickEvent(QMouseEvent*) {
  if (isWindow() || picture_.isNull()) return;
  if (window_ == nullptr) {
    window_ = new PictureView(this, Qt::Window);
    window_->setWindowTitle(tr("fusion_view"));
    window_->resize(picture_.size());
  }
  window_->set_picture(picture_);
  window_->show();
  window_->raise();
}

}  // namespace usct::ros_interface
