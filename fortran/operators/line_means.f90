!> Means of the lines across a slender contact, continued to the ends of the lines.
!>
!> There the surface falls off with the logarithm of the distance, over the length of the contact.
!>
!> Equations: docs/theory/preconditioner.md.
module hc_line_means
  use hc_precision, only: sp, lk
  implicit none
  private

  public :: line_means_t, new_line_means

  !> Lines across a slender contact.
  type :: line_means_t
    private
    !> Dimension across the contact, lines on each side that share a mean, and threads
    integer :: across = 0, reach = 0, threads = 1
    !> Increment of a line beyond the edge over its mean, 0 on active nodes (n_col, n_row); 1 over the weights of the mean
    real(sp), allocatable :: floor(:, :), weight(:)
    !> Active nodes of each line
    integer, allocatable :: n_line(:)
  contains
    !> Means of a field
    procedure :: mean
    !> Continue means of a field beyond the edge
    procedure :: add
    !> The transposes of both: shares of the means, and add them to the active nodes
    procedure :: share
    procedure :: hand_back
  end type line_means_t

contains

  !> Set up the lines of a contact.
  subroutine new_line_means(self, active, continued, across, reach, height, threads)
    type(line_means_t), intent(out) :: self
    !> Active nodes (n_col, n_row)
    logical(lk), intent(in) :: active(:, :)
    !> One on active nodes, as it is continued otherwise (n_col, n_row)
    real(sp), intent(in) :: continued(:, :)
    !> Dimension across the contact, lines on each side that share a mean, and threads
    integer, intent(in) :: across, reach, threads
    !> Height at the end of a line over the mean
    real(sp), intent(in) :: height
    integer :: row

    self%across = across
    self%reach = reach
    self%threads = threads
    self%n_line = count(active, dim=across)
    self%weight = 1.0_sp/max(tent(reach, real(self%n_line, sp)), 1.0_sp)
    self%floor = height*(1.0_sp - continued)
    do row = 1, size(active, 2)
      if (across == 2) then
        where (self%n_line == 0) self%floor(:, row) = 0.0_sp
      else if (self%n_line(row) == 0) then
        self%floor(:, row) = 0.0_sp
      end if
      where (active(:, row)) self%floor(:, row) = 0.0_sp
    end do
  end subroutine new_line_means

  !> Sum the values of lines over those nearby, with weights that fall off evenly.
  pure function tent(reach, value) result(total)
    !> Lines on each side
    integer, intent(in) :: reach
    real(sp), intent(in) :: value(:)
    real(sp) :: total(size(value))
    integer :: k

    total = (reach + 1)*value
    do k = 1, min(reach, size(value) - 1)
      total = total + (reach + 1 - k)*(eoshift(value, k) + eoshift(value, -k))
    end do
  end function tent

  !> Compute the means of the active nodes of the lines, each over lines nearby.
  pure function mean(self, field)
    class(line_means_t), intent(in) :: self
    !> Field over the window (n)
    real(sp), intent(in) :: field(size(self%floor, 1), size(self%floor, 2))
    real(sp), allocatable :: mean(:)

    mean = sum(field, dim=self%across, mask=.not. self%floor > 0.0_sp)
    where (self%n_line == 0) mean = 0.0_sp
    mean = self%weight*tent(self%reach, mean)
  end function mean

  !> Add the continued means to a field.
  subroutine add(self, mean, field)
    class(line_means_t), intent(in) :: self
    real(sp), intent(in) :: mean(:)
    !> Field over the window (n)
    real(sp), intent(inout) :: field(size(self%floor, 1), size(self%floor, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%threads)
    do row = 1, size(field, 2)
      if (self%across == 1) then
        field(:, row) = field(:, row) + mean(row)*self%floor(:, row)
      else
        field(:, row) = field(:, row) + mean*self%floor(:, row)
      end if
    end do
    !$omp end parallel do
  end subroutine add

  !> Compute the shares of the active nodes of each line in a field beyond the edge.
  pure function share(self, field)
    class(line_means_t), intent(in) :: self
    !> Field over the window (n)
    real(sp), intent(in) :: field(size(self%floor, 1), size(self%floor, 2))
    real(sp), allocatable :: share(:)

    share = tent(self%reach, self%weight*sum(field*self%floor, dim=self%across))
  end function share

  !> Add shares to the active nodes of the lines.
  subroutine hand_back(self, share, field)
    class(line_means_t), intent(in) :: self
    real(sp), intent(in) :: share(:)
    !> Field over the window (n)
    real(sp), intent(inout) :: field(size(self%floor, 1), size(self%floor, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%threads)
    do row = 1, size(field, 2)
      if (self%across == 1) then
        if (self%n_line(row) > 0) where (.not. self%floor(:, row) > 0.0_sp) field(:, row) = field(:, row) + share(row)
      else
        where (self%n_line > 0 .and. .not. self%floor(:, row) > 0.0_sp) field(:, row) = field(:, row) + share
      end if
    end do
    !$omp end parallel do
  end subroutine hand_back

end module hc_line_means
